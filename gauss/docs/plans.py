"""The table of plans as the code has it: rules in order, and the conditions that each has, by their docstrings."""

import re

from gauss.dynamics import plan
from gauss.dynamics.rules import Rule, RuleTable

JOINED = re.compile(r" and (?=[A-Z])")  # of two conditions
TABLES = {
    "Motions, by `gauss.simulate`": plan.MOTIONS,
    "Batches, by `gauss.rollout`": plan.BATCHES,
    "Accelerations of a state, by `System.accelerations`": plan.ACCELERATIONS,
    "Functions of a state, by `System.function`": plan.FUNCTIONS,
    "Accelerations on a device, by `System.function(device=)`": plan.DEVICE_FUNCTIONS,
}


def plan_tables() -> str:
    """Tables in Markdown."""
    return "\n\n".join(part for title, table in TABLES.items() for part in (f"### {title}", _table(table))) + "\n"


def _table(table: RuleTable) -> str:
    head = ["| | driver | dynamics | applies to | if | then, where a check fails |", "|---|---|---|---|---|---|"]
    return "\n".join(head + [f"| {k} | {_row(rule)} |" for k, rule in enumerate(table.rules, 1)])


def _row(rule: Rule) -> str:
    conditions = "; ".join(_said(condition) for condition in rule.conditions) or "always"
    cells = rule.driver, rule.dynamics, _said(rule.when), conditions, rule.fallback or "–"
    return " | ".join(cell.replace("|", "\\|") for cell in cells)


def _said(condition) -> str:
    """First sentences of the docstrings of a condition, or of two that are joined, as part of a sentence."""
    sentence = (condition.__doc__ or "").strip().partition("\n")[0].rstrip(".")
    parts = [part.removeprefix("Whether ") for part in JOINED.split(sentence)]
    return " and ".join(part[:1].lower() + part[1:] for part in parts) or "all"
