"""Stages of the reduction of a system, by the passes that made them."""

from gauss.system.passes import PASSES


def stages(system) -> dict:
    """Stage of each pass, by its function."""
    return dict(zip(PASSES.values(), system.reduction[1:], strict=True))


def rows(stage) -> int:
    """Rows of the constraints that a stage leaves."""
    return sum(part.n_rows for part in stage.subsystems)
