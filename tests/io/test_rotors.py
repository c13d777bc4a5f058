"""Rotor networks in files, on the command line and in pictures."""

import re
from pathlib import Path

import numpy as np
import pytest
from typer.testing import CliRunner

import gauss
from gauss import cli
from gauss.errors import FileError
from gauss.io import networks, write_csv
from gauss.rotors import Network, Viscous, simulate, table
from gauss.view import draw_network, plot_rotors
from gauss.view.rotors import layout
from tests.support.files import call
from tests.support.rotor_networks import reference

SHIPPED = {"gear_runup": "gear-runup", "friction_chain": "friction-chain", "parallel_branches": "parallel", "stall": "stall"}


@pytest.mark.parametrize("name", sorted(networks()))
def test_shipped_networks_survive_a_file(name, tmp_path):
    network = gauss.load_rotors(name)
    assert gauss.load_rotors(gauss.save_rotors(network, tmp_path / "network.toml")) == network


@pytest.mark.parametrize("name", SHIPPED)
def test_shipped_networks_are_those_of_the_reference(name):
    """Only the names differ."""
    ours, (theirs, _) = gauss.load_rotors(name), reference(SHIPPED[name])
    for pairs in zip(ours.shafts.values(), theirs.shafts.values(), strict=True):
        assert len({(s.inertia, s.speed, s.angle) for s in pairs}) == 1
    plain = lambda link: {**vars(link), "name": "", "driven": "", "driver": ""}  # noqa: E731
    assert list(map(plain, ours.links.values())) == list(map(plain, theirs.links.values()))
    laws = [[(t.law, t.begin, t.until, t.role) for t in n.torques.values()] for n in (ours, theirs)]
    assert laws[0] == laws[1]


HEAD = '[[shaft]]\nname = "a"\ninertia = 1.0\n[[shaft]]\nname = "b"\ninertia = 1.0\n'
WRONG = {
    "not toml": ("[[shaft", "not a TOML file"),
    "unknown section": ("[[gears]]\n", "unknown section 'gears'.*Did you mean 'gear'"),
    "single brackets": ('[shaft]\nname = "c"', r"write \[\[shaft\]\]"),
    "unknown key": (HEAD + '[[gear]]\nname = "g"\ndriven = "a"\ndriver = "b"\nratoi = 2.0', "unknown key 'ratoi'.*'ratio'"),
    "missing key": ('[[shaft]]\nname = "c"', "missing inertia"),
    "unknown shaft": (HEAD + '[[gear]]\nname = "g"\ndriven = "a"\ndriver = "c"\nratio = 2.0', "no shaft 'c'"),
    "unknown law": (HEAD + '[[torque]]\nshaft = "a"\nlaw = "klos"', "unknown law 'klos'.*'kloss'"),
    "wrong value of a law": (HEAD + '[[torque]]\nshaft = "a"\nlaw = "viscous"\nvalu = 1.0', "no value 'valu'.*'value'"),
    "missing value of a law": (HEAD + '[[torque]]\nshaft = "a"\nlaw = "linear"\nstiffness = 1.0', "missing omega_0"),
    "torque without law": (HEAD + '[[torque]]\nshaft = "a"', "missing law"),
    "negative value": (HEAD + '[[torque]]\nshaft = "a"\nlaw = "dry"\nvalue = -1.0', "value: expected a non-negative"),
    "wrong curve": (
        HEAD + '[[friction_drive]]\nname = "f"\ndriven = "a"\ndriver = "b"\ncurve = { A = 4.0 }',
        "curve: expected",
    ),
}


@pytest.mark.parametrize("case", WRONG)
def test_wrong_files_are_refused_with_the_place(case, tmp_path):
    text, words = WRONG[case]
    path = tmp_path / "network.toml"
    path.write_text(text)
    with pytest.raises(FileError, match=words) as error:
        gauss.load_rotors(path)
    assert str(path) in str(error.value)


def test_shipped_networks_are_listed():
    output = CliRunner().invoke(cli.app, ["models"]).output
    assert all(f"{name} " in output and line in output for name, line in networks().items())


def test_functions_do_not_fit_into_files(tmp_path):
    network = Network("n")
    network.shaft("a", 1.0)
    network.torque("a", lambda t, angle, speed: 1.0)
    with pytest.raises(FileError, match="Python function"):
        gauss.save_rotors(network, tmp_path / "n.toml")
    with pytest.raises(FileError, match="written as .toml"):
        gauss.save_rotors(Network("n"), tmp_path / "n.json")
    with pytest.raises(FileError, match="Did you mean 'harvester'"):
        gauss.load_rotors("harvestr")


@pytest.mark.slow
def test_command_line_reports_draws_and_writes(tmp_path):
    files = {key: tmp_path / name for key, name in {"plot": "a.png", "network": "b.svg", "csv": "c.csv"}.items()}
    options = [x for key, path in files.items() for x in (f"--{key}", path)]
    result = call("rotors", "stall", "--duration", 4, "--samples", 41, "--steady", "--modes", "--explain", *options)
    assert result.exit_code == 0, result.output
    assert re.search(r"2\.67489\d s +stall +output", result.output)
    assert "J ω̇ = Q" in result.output and "balance within" in result.output and "stable: speeds" in result.output
    assert files["plot"].read_bytes().startswith(b"\x89PNG") and b"<svg" in files["network"].read_bytes()
    table = np.genfromtxt(files["csv"], delimiter=",", skip_header=1)
    assert table.shape == (41, 1 + 3 * 2 + 3) and table[-1, 0] == 4.0


@pytest.mark.parametrize(
    "arguments, words",
    [
        (("gear_runp",), "Did you mean 'gear_runup'"),
        (("stall", "--duration", -1), "duration: expected a positive number"),
        (("stall", "--method", "euler"), "no method 'euler'"),
        (("stall", "--duration", 0.1, "--samples", 3, "--plot", "a.txt"), "saved as one of"),
        (("stall", "--duration", 0.1, "--samples", 3, "--output", "a.txt"), "written as .npz or .csv"),
    ],
)
def test_errors_name_what_is_wrong(arguments, words):
    result = call("rotors", *arguments)
    assert isinstance(result.exception, gauss.GaussError) and words in str(result.exception)


def test_a_belt_driven_backward_is_a_warning():
    result = call("rotors", "gear_runup", "--duration", 7, "--samples", 3)
    assert result.exit_code == 0 and "warning: gear 'belt' of constant slip is driven backward" in result.stderr


@pytest.mark.parametrize("name", sorted(networks()))
def test_drawing_places_every_shaft_apart(name):
    network = gauss.load_rotors(name)
    places = layout(network)
    assert set(places) == set(network.shafts) and len(set(places.values())) == len(places)
    for link in network.links.values():
        assert places[link.driver][0] < places[link.driven][0]
    axes = draw_network(network).axes[0]
    words = {text.get_text().split("\n")[0] for text in axes.texts}
    assert set(network.shafts) <= words and set(network.links) <= words


def test_a_network_too_large_for_a_page_is_not_drawn():
    network = Network("long")
    for j in range(1000):
        network.shaft(f"s{j}", 1.0)
        if j:
            network.gear(f"g{j}", f"s{j}", f"s{j - 1}", 1.01)
    with pytest.raises(FileError, match="1000 shafts; at most 60"):
        draw_network(network)


def test_figure_has_units_and_every_shaft(tmp_path):
    network = gauss.load_rotors("friction_chain")
    figure = plot_rotors(simulate(network, 0.2))
    labels = [axes.get_ylabel() for axes in figure.axes]
    assert [re.search(r"\[(.*?)\]", label)[1] for label in labels] == ["rad/s", "1", "N m", "J"]
    assert len(figure.axes[0].lines) >= len(network.shafts)
    network.torque("motor", Viscous(0.1))
    with pytest.raises(FileError, match="cannot be written"):
        write_csv(table(simulate(network, 0.01)), Path("/nowhere/at/all.csv"))
