"""The table of plans as the code has it: rules in order, and the conditions that each has, by their docstrings."""

from gauss.dynamics import plan
from gauss.dynamics.rules import Rule, RuleTable

TABLES = {
    "Motions, by `gauss.simulate`": plan.MOTIONS,
    "Batches, by `gauss.rollout`": plan.BATCHES,
    "Accelerations of a state, by `System.accelerations`": plan.ACCELERATIONS,
    "Functions of a state, by `System.function`": plan.FUNCTIONS,
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
    """First sentence of the docstring of a condition, as part of a sentence."""
    sentence = (condition.__doc__ or "").strip().partition("\n")[0].rstrip(".").removeprefix("Whether ")
    return sentence[:1].lower() + sentence[1:] if sentence else "all"
