"""Functions of a system for compiled loops, by the dynamics of a :class:`gauss.dynamics.rules.Plan`.

Each is imported where it is asked for: one motion needs one of them.
"""

from gauss.dynamics.traced_system import Program


def program_of(dynamics: str) -> type[Program]:
    """Class of the functions of a system for compiled loops and batches."""
    match dynamics:
        case "tree recursion":
            from gauss.dynamics.tree_program import TreeProgram

            return TreeProgram
        case "call graph":
            from gauss.dynamics.call_graph_program import CallGraphProgram

            return CallGraphProgram
        case "callbacks":
            from gauss.dynamics.called_program import CalledProgram

            return CalledProgram
        case "embedded loops":
            from gauss.dynamics.embedded_program import EmbeddedProgram

            return EmbeddedProgram
        case _:
            return Program
