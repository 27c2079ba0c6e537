"""The commands of the wheel: each runs the script of its name, which is beside the package as in an installation by CMake."""
import runpy
import sys
from pathlib import Path


def script_path(name):
    """drivers/FOLDER/NAME.py of a source tree, share/gravier/FOLDER/NAME.py of an installation, gravier/scripts/FOLDER/NAME.py of a wheel."""
    folder, here = name.removeprefix("gravier_"), Path(__file__).resolve()
    places = [root / folder / f"{name}.py" for root in (here.parent / "scripts", here.parents[2])]
    return next((place for place in places if place.is_file()), places[0])


def _run(name):
    path = script_path(name)
    # as for a script that is started by its path
    sys.path.insert(0, str(path.parent))
    runpy.run_path(str(path), run_name="__main__")


def gravier_blocks():
    _run("gravier_blocks")


def gravier_import():
    _run("gravier_import")


def gravier_join():
    _run("gravier_join")


def gravier_measure():
    _run("gravier_measure")


def gravier_plot():
    _run("gravier_plot")


def gravier_report():
    _run("gravier_report")


def gravier_rough_walls():
    _run("gravier_rough_walls")
