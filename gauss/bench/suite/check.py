"""References are checked, not trusted: nothing leaves the suite whose verdict is not proven to the digits that it claims."""

from dataclasses import replace

from gauss.bench.suite.cones import refined_with_cones
from gauss.bench.suite.instance import INFEASIBLE, SOLVED, SuiteInstance, with_reference
from gauss.bench.suite.optimality import certificate_residual, ray_residual, residuals
from gauss.bench.suite.refine import refined
from gauss.errors import BackendError

EXACT = 1e-25  # largest residual of a reference, relative
ROUNDED = 1e-12  # the same, where the rounding of rows that depend on each other leaves a contradiction, which is reported
STEEP = 1e-9  # relative: a certificate or ray that shows less might be rounding of the data


def checked(instance: SuiteInstance) -> SuiteInstance:
    """The instance with its reference, confirmed.

    Raises
    ------
    BackendError
        If the reference, the certificate or the ray does not hold.
    """
    if instance.verdict == SOLVED:
        reference = instance.reference or (refined_with_cones(instance) if instance.cones else refined(instance))
        worst = max(residuals(instance, reference.x, reference.y, reference.z, reference.z_box))
        if worst > (ROUNDED if reference.contradiction else EXACT):
            raise BackendError(f"{instance.name}: the reference leaves {worst:.1e}.")
        return with_reference(instance, replace(reference, residual=worst))
    reference = instance.proof
    if instance.verdict == INFEASIBLE:
        worst, slope = certificate_residual(instance, reference.y, reference.z, reference.z_box)
    else:
        worst, slope = ray_residual(instance, reference.ray)
        worst = max(worst, residuals(instance, reference.x, reference.y, reference.z, reference.z_box).primal)
    if worst > EXACT or slope < STEEP:
        raise BackendError(
            f"{instance.name}: its verdict is not proven, the proof leaves {worst:.1e} and shows {slope:.1e}."
        )
    return with_reference(instance, replace(reference, residual=worst))
