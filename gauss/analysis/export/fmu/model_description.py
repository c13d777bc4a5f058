"""``modelDescription.xml`` of a unit (FMI 3.0, section 2.4), and ``buildDescription.xml`` of its sources."""

from collections.abc import Iterator, Mapping
from datetime import UTC, datetime
from typing import NamedTuple
from xml.sax.saxutils import quoteattr

from gauss.errors import ArgumentError
from gauss.system import State, System
from gauss.system.coordinate_names import state_names
from gauss.versions import VERSION


class Variable(NamedTuple):
    """A variable of a unit."""

    name: str  # its name
    reference: int  # its value reference
    attributes: dict[str, str]  # attributes of its element

    def __str__(self) -> str:
        pairs = {"name": self.name, "valueReference": str(self.reference), "variability": "continuous"} | self.attributes
        return f"    <Float64 {' '.join(f'{key}={quoteattr(value)}' for key, value in pairs.items())}/>"


class UnitNames:
    """Names of the variables of a unit, of which no two are equal."""

    def __init__(self):
        self.taken = set[str]()

    def own(self, name: str, kind: str) -> str:
        """Name that no other variable has: the given one, or one with the kind before it.

        ArgumentError if it cannot be printed.
        """
        if not name.isprintable():
            raise ArgumentError(f"to_fmu: {name!r}: a unit cannot hold this name; use letters that can be printed.")
        while name in self.taken:
            name = f"{kind} {name}"
        self.taken.add(name)
        return name


def variables(system: System, start: State, parameters: Mapping[str, float]) -> dict[str, list[Variable]]:
    """Variables of a unit by kind, in the order of their value references; parameters by name, with their values.

    Each has a name of its own: one that is taken, as that of an input named after its joint, gets its kind before it.

    ArgumentError if a name cannot be printed, which the description cannot hold.
    """
    scene, states, named = system.scene, state_names(system), UnitNames()
    order = "time", "states", "derivatives", "inputs", "parameters", "outputs"
    kinds: dict[str, list[Variable]] = {kind: [] for kind in order}
    kinds["time"].append(Variable(named.own("time", "time"), 0, {"causality": "independent"}))
    reference, values = 1, [*start.q, *start.v]
    shown = "local" if scene.outputs else "output"
    for (name, unit), value in zip(states.items(), values, strict=True):
        given = {"causality": shown, "initial": "exact", "start": repr(float(value)), "description": f"[{unit}]"}
        kinds["states"].append(Variable(named.own(name, "state"), reference, given))
        reference += 1
    for k, state in enumerate(tuple(kinds["states"])):
        given = {"causality": "local", "initial": "calculated", "derivative": str(k + 1)}
        kinds["derivatives"].append(Variable(named.own(f"der({state.name})", "derivative"), reference, given))
        reference += 1
    for name in scene.inputs:
        kinds["inputs"].append(Variable(named.own(name, "input"), reference, {"causality": "input", "start": "0.0"}))
        reference += 1
    for name, value in parameters.items():
        given = {"causality": "parameter", "variability": "tunable", "initial": "exact", "start": repr(float(value))}
        kinds["parameters"].append(Variable(named.own(name, "parameter"), reference, given))
        reference += 1
    for output in scene.outputs.values():
        size = output.size(scene)
        for k in range(size):
            name = output.name if size == 1 else f"{output.name}[{k}]"
            label = named.own(name, "output")
            kinds["outputs"].append(Variable(label, reference, {"causality": "output", "initial": "calculated"}))
            reference += 1
    return kinds


def model_description(system: System, identifier: str, token: str, found: dict[str, list[Variable]]) -> str:
    """Text of ``modelDescription.xml``."""
    return "\n".join(_description(system, identifier, token, found))


def _description(system: System, identifier: str, token: str, found: dict[str, list[Variable]]) -> Iterator[str]:
    yield '<?xml version="1.0" encoding="UTF-8"?>'
    yield f'<fmiModelDescription fmiVersion="3.0" modelName={quoteattr(system.scene.name)}'
    made = datetime.now(UTC).strftime("%Y-%m-%dT%H:%M:%SZ")
    yield f'    instantiationToken="{token}" generationTool="gauss {VERSION}" generationDateAndTime="{made}">'
    yield f'  <ModelExchange modelIdentifier="{identifier}" needsCompletedIntegratorStep="true"/>'
    yield f'  <CoSimulation modelIdentifier="{identifier}" canHandleVariableCommunicationStepSize="true"/>'
    yield '  <DefaultExperiment startTime="0" stopTime="1"/>'
    yield "  <ModelVariables>"
    yield from (str(variable) for kind in found.values() for variable in kind)
    yield "  </ModelVariables>"
    yield "  <ModelStructure>"
    outputs = [one for kind in found.values() for one in kind if one.attributes["causality"] == "output"]
    yield from (f'    <Output valueReference="{one.reference}"/>' for one in outputs)
    yield from (f'    <ContinuousStateDerivative valueReference="{one.reference}"/>' for one in found["derivatives"])
    unknown = [*found["derivatives"], *found["outputs"]]
    yield from (f'    <InitialUnknown valueReference="{one.reference}"/>' for one in unknown)
    yield "  </ModelStructure>"
    yield "</fmiModelDescription>\n"


def build_description(identifier: str, sources: list[str]) -> str:
    """Text of ``sources/buildDescription.xml``."""
    files = "\n".join(f'      <SourceFile name="{name}"/>' for name in sources)
    return (
        '<?xml version="1.0" encoding="UTF-8"?>\n<fmiBuildDescription fmiVersion="3.0">\n'
        f'  <BuildConfiguration modelIdentifier="{identifier}">\n    <SourceFileSet language="C99">\n{files}\n'
        "    </SourceFileSet>\n  </BuildConfiguration>\n</fmiBuildDescription>\n"
    )
