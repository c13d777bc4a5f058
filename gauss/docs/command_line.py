"""The page of the command line: every command with its arguments, from what ``--help`` says."""

from collections.abc import Iterator

INTRODUCTION = (
    "`gauss --help` lists the commands, `gauss COMMAND --help` their options. Wherever a scene is asked for, it is a file, "
    "the name of a [model](../models.md), or `robot:NAME`. Errors are one line, with the remedy, and end with code 2. "
    "`gauss --install-completion` lets the shell complete commands and options."
)


def commands(group) -> str:
    """Page in Markdown.

    Parameters
    ----------
    group : click.Group
        All commands of the program.
    """
    return "\n\n".join(["# The command line", INTRODUCTION, *_described(group, "gauss")]) + "\n"


def _described(group, name: str) -> Iterator[str]:
    for key, command in group.commands.items():
        if hasattr(command, "commands"):
            yield from _described(command, f"{name} {key}")
        else:
            yield f"## `{name} {key}`"
            yield (command.help or "").strip()
            yield "\n".join(["| | |", "|---|---|", *_rows(command.params)])


def _rows(parameters) -> Iterator[str]:
    for parameter in parameters:
        is_option = parameter.param_type_name == "option"
        shown = ", ".join([*parameter.opts, *parameter.secondary_opts]) if is_option else parameter.name.upper()
        yield f"| `{shown}` | {' '.join((parameter.help or '').replace('|', '/').split())} |"
