"""Input that must be refused: exit status 2, one line on the standard error that says where, what and what was expected, and
no file touched. A hang of the ranks that know of no error shows as a timeout. Every fifth input
file runs on two ranks too, and all of them do in `./gravier test long`."""
import os
import shutil
import unittest

import h5py
import numpy as np

from gravier_runs import LONG, RunTestCase, each, gravier, merged, namelist, run_case, write

CASE = {
    "scene": {"dimension": 2, "bodies": "lattice", "lattice_count": [6, 5], "radius_min": 0.01, "radius_max": 0.01},
    "time": {"step": 1e-3, "steps": 2},
    "output": {"directory": "results"},
}
COLUMN = {"scene": {"bodies": "column", "column_count": 4, "lattice_count": None, "radius_min": None, "radius_max": None}}
GOOD = namelist(CASE)


def case(*parts):
    return namelist(merged(CASE, *parts))


def key(group, name, value, *words, also=None, kind=None):
    """The good case with one bad key, given as the text that the file has; the message repeats group, key and value."""
    base = merged(CASE, COLUMN) if kind == "column" else CASE
    base = merged(base, also or {}, {group: {name: "@"}})
    text = namelist(base).replace(f"{name} = '@'", f"{name} = {value}")
    return f"{group} {name} = {value} {sorted((also or {}).items()) or ''}", text, ("&" + group, f"{name} = {value}", *words)


PLANE = {"shape": "plane", "point": [0.0, -0.1], "normal": [0.0, 1.0]}
LID = {"name": "lid", "shape": "plane", "point": [0.0, 1.0], "normal": [0.0, -1.0], "free": [False, True], "mass": 1.0}
LEFT, RIGHT = ({"shape": "plane", "point": [x, 0.0], "normal": [-x, 0.0]} for x in (-1.0, 1.0))
CASE_3D = merged(CASE, {"scene": {"dimension": 3, "lattice_count": [2, 2, 2]}})


def boundary_key(name, value, *words, also):
    """The good case with a boundary that has one bad key."""
    text = namelist(merged(CASE, {"boundary": {**also, name: "@"}})).replace(f"{name} = '@'", f"{name} = {value}")
    return f"boundary {name} = {value}", text, ("&boundary", f"{name} = {value}", *words)


def bodies_case(path, boundary=(), **scene):
    return namelist({"scene": {"bodies": "file", "bodies_file": path, **scene}, "boundary": list(boundary), "time": CASE["time"],
                     "output": CASE["output"]})


# title, content of the input file, what the message must have besides the name of the file
FILES = [
    ("empty", "", ("empty file", "&scene")),
    ("blank", "\n  \n\t\n", ("empty file",)),
    ("comments only", "! nothing here\n", ("empty file",)),
    ("prose", "Let 600 disks fall into a box.\n\nThen stir.\n", ("not a namelist", "line 1", "Let 600 disks fall into a box.")),
    ("prose after a group", GOOD + "that is all\n", ("not a namelist", "that is all")),
    ("binary", np.random.default_rng(1).bytes(5000), ("not a namelist",)),
    ("zeros", bytes(4096), ("not a namelist",)),
    ("an HDF5 file", b"\x89HDF\r\n\x1a\n" + bytes(512), ("not a namelist",)),
    ("unknown group", GOOD + "&solvers /\n", ("unknown group &solvers", "did you mean &solver?")),
    ("strange group", GOOD + "&weather rain = 1 /\n", ("unknown group &weather", "expected one of", "&decomposition")),
    ("unknown key", GOOD + "&solver tolerence = 1e-4 /\n", ("unknown key 'tolerence' in &solver", "did you mean 'tolerance'?")),
    ("strange key", GOOD + "&solver rain = 1 /\n", ("unknown key 'rain' in &solver", "expected one of", "max_iterations")),
    ("key of another group", GOOD + "&solver friction = 0.3 /\n", ("unknown key 'friction' in &solver", "belongs to &scene")),
    ("group twice", GOOD + "&time step = 1, steps = 1 /\n", ("group &time is given twice", "expected once")),
    ("key twice", GOOD + "&solver sweeps = 2, sweeps = 3 /\n", ("&solver sweeps = 3", "given twice", "sweeps = 2")),
    ("no &time", GOOD.replace("&time", "&solver").replace("step = 0.001", "").replace("steps = 2", ""), ("&time", "missing")),
    ("no &scene", "&time step = 1e-3, steps = 2 /\n", ("&scene", "missing")),
    ("no step", case({"time": {"step": None}}), ("&time step is missing", "expected a finite real number > 0")),
    ("no steps", case({"time": {"steps": None}}), ("&time steps is missing", "expected an integer >= 0")),
    ("no bodies", case({"scene": {"bodies": None}}), ("&scene bodies is missing", "'lattice'")),
    ("no radius", case({"scene": {"radius_max": None}}), ("&scene radius_max is missing", "bodies = 'lattice'")),
    ("no bodies file", "&scene bodies = 'file' /\n&time step = 1, steps = 1 /\n", ("&scene bodies_file is missing",)),
    ("group not closed", GOOD + "&solver sweeps = 2\n", ("group &solver", "not closed", "expected /")),
    ("quote not closed", GOOD.replace("'results'", "'results"), ("&output directory", "expected a quote that closes")),
    ("no equal sign", GOOD + "&solver sweeps 2 /\n", ("&solver", "expected key = value", "sweeps 2")),
    ("word without quotes", GOOD + "&solver method = nscdd /\n", ("&solver method = nscdd", "'nscdd_ep'")),
    key("output", "fclib_step", "3", "at most steps = 2"),
    key("output", "tracked_bodies", "77", "expected the identifiers of bodies of the scene"),
    key("output", "tracked_bodies", "1, 2, 1", "expected each identifier once"),
    key("output", "tracked_bodies", "1, -2", "expected at most 8 integers >= 1"),
    key("output", "tracked_forces", ".true.", "expected .false. without tracked_bodies"),
    key("output", "final_forces", ".true.", "without final_bodies = .true."),
    # the type
    key("time", "step", "'fast'", "expected a finite real number > 0 (s)"),
    key("time", "step", "1e-3 s", "expected a finite real number > 0 (s)"),
    key("time", "steps", "1.5", "expected an integer >= 0"),
    key("time", "steps", "99999999999", "expected an integer >= 0, at most 2147483647"),
    key("solver", "warm_start", "maybe", "expected"),
    key("solver", "sweeps", ".true.", "expected an integer >= 1"),
    key("scene", "title", "5", "expected"),
    key("scene", "gravity", "0, 0, 0, 0", "expected at most 3"),
    key("scene", "gravity", "-9.81", "&scene gravity = -9.81: expected 2 numbers"),
    key("scene", "friction", "0.3, 0.4", "expected a finite real number >= 0"),
    # the range
    key("time", "step", "-1e-3", "expected a finite real number > 0 (s)"),
    key("time", "step", "0", "expected a finite real number > 0 (s)"),
    key("time", "step", "NaN", "expected a finite real number > 0 (s)"),
    key("time", "step", "Inf", "expected a finite real number > 0 (s)"),
    key("time", "step", "1e999", "expected a finite real number > 0 (s)"),
    key("time", "steps", "-1", "expected an integer >= 0"),
    key("time", "theta", "0.4", "[0.5, 1]"),
    key("time", "theta", "1.1", "[0.5, 1]"),
    key("time", "theta", "NaN", "[0.5, 1]"),
    key("scene", "dimension", "4", "2 or 3"),
    key("scene", "gravity", "0, NaN, 0", "finite"),
    key("scene", "gravity", "0, -Infinity, 0", "finite"),
    key("scene", "gravity", "0, 0, -9.81", "third component of 0 where dimension = 2"),
    key("scene", "radius_min", "0", "> 0"),
    key("scene", "radius_min", "-0.01", "> 0"),
    key("scene", "radius_min", "0.02", "at most radius_max", "0.01"),
    key("scene", "radius_max", "NaN", "> 0"),
    key("scene", "radius", "0", "> 0", kind="column"),
    key("scene", "radius", "-1", "> 0", kind="column"),
    key("scene", "radius", "Inf", "> 0", kind="column"),
    key("scene", "mass", "0", "> 0", kind="column"),
    key("scene", "column_count", "0", ">= 1", kind="column"),
    key("scene", "lattice_count", "0, 5", "2 integers >= 1"),
    key("scene", "lattice_count", "100000, 100000", "at most 2147483647 bodies"),
    key("scene", "density", "0", "> 0"),
    key("scene", "friction", "-0.1", ">= 0"),
    key("scene", "wall_friction", "NaN", ">= 0"),
    key("scene", "rolling_friction", "-0.1", ">= 0"),
    key("scene", "wall_rolling_friction", "Inf", ">= 0"),
    key("scene", "rolling_friction", "0.1", "expected 0 where rotation = .false.: bodies that do not turn do not roll", also={"scene": {"rotation": False}}),
    key("scene", "wall_rolling_friction", "0.1", "0 where rotation = .false.", also={"scene": {"rotation": False}}),
    key("boundary", "rolling_friction", "0.1", "0 where rotation = .false.", also={"scene": {"rotation": False}, "boundary": PLANE}),
    key("scene", "pivoting_friction", "0.1", "0 where dimension = 2"),
    key("scene", "wall_tangential_restitution", "1.1", "in [0, 1]"),
    key("solver", "method", "'nscdd_ep'", "'nlgs', 'schwarz', 'nscdd' or 'newton' with rolling", also={"scene": {"wall_rolling_friction": 0.1}}),
    key("solver", "method", "'schwarz_ec'", "with rolling", also={"boundary": {**PLANE, "rolling_friction": 0.1}}),
    key("output", "fclib_step", "1", "0 with rolling", also={"scene": {"rolling_friction": 0.1}}),
    boundary_key("pivoting_friction", "0.1", "0 where dimension = 2", also=PLANE),
    boundary_key("tangential_restitution", "-0.1", "in [0, 1]", also=PLANE),
    key("scene", "alert_distance", "-1e-3", ">= 0"),
    key("solver", "tolerance", "0", "> 0"),
    key("solver", "tolerance", "-1e-3", "> 0"),
    key("solver", "tolerance", "NaN", "> 0"),
    key("solver", "max_iterations", "0", ">= 1"),
    key("solver", "sweeps", "0", ">= 1"),
    key("solver", "check_every", "0", ">= 1"),
    key("enriched", "direction", "-1", ">= 0"),
    key("enriched", "cg_tolerance", "1", "(0, 1)"),
    key("output", "every", "-1", ">= 0"),
    # boundaries
    ("a group of two boundaries", bodies_case("bodies.csv", boundary=[{"name": name, "shape": "grains", "group": group}
                                                                      for name, group in (("a", 2), ("b", 3), ("c", 2))]),
     ("&boundary (the 3rd, 'c') group = 2", "a group of its own, but the 1st has it too")),
    # names that are the same in the columns of history.csv, and those of walls
    *(("boundaries " + " and ".join(names), case({"boundary": [{**PLANE, "name": name} for name in names]}), words) for names, words in (
        (("a,b", "a_b"), ("&boundary (the 2nd, 'a_b') name = 'a_b'", "in the columns of history.csv, but the 1st is 'a_b' there too")),
        (("floor", "wall 31"), ("&boundary name = 'wall 31': expected a name of its own, but the wall 31 of the scene has it too",)),
        (("n"*65,), ("name = '" + "n"*65 + "': expected at most 64 characters, here 65",)))),
    # a list of names with an empty one
    ("law of a material that is none of three", f"{GOOD}&material name = 'a' /\n&material name = 'b' /\n&material name = 'c' /\n"
     "&law materials = 'a', 'd', kind = 'none' /\n", ("&law (the 1st) materials = 'a', 'd': expected 'a', 'b' or 'c'",)),
    *((f"law of {materials}", f"{GOOD}&material name = 'a' /\n&law materials = {materials}, kind = 'none' /\n",
       (f"&law (the 1st) materials = {materials}: expected at most 2 texts in quotes, none of them empty",))
      for materials in ("'a', ''", "'', 'a'", "''")),
    *(boundary_key(name, value, *words, also=also) for name, value, words, also in (
        ("force", "0, 1", ("0 along each component that is not free",), {**PLANE, "free": [True, False], "mass": 1.0}),
        ("pressure", "1", ("0 where no component along normal is free",), {**PLANE, "free": [True, False], "mass": 1.0}),
        ("normal", "0, 0", ("not all 0",), {"shape": "plane"}),
    )),
    # a pressure without an area
    *((title, case(COLUMN, {"boundary": [{**LID, "pressure": 10.0, **lid}, *sides]}), ("boundary 'lid': pressure: expected", words))
      for title, lid, sides, words in (
        ("pressure between no sides", {}, [], "two planes that face each other along x in the whole run, or a period, because their distance gives the area; or `force` instead"),
        ("pressure beside one side", {}, [LEFT], "face each other along x"),
        ("pressure between sides of which one goes", {}, [LEFT, {**RIGHT, "remove_at": 1.0}], "face each other along x"),
        ("pressure on what is oblique", {"normal": [0.3, -1.0]}, [LEFT, RIGHT], "a plane whose normal lies along an axis"))),
    ("pressure on a side of an open cell", case(COLUMN, {"scene": {"dimension": 3, "period": [0.0, 1.0, 0.0]}, "boundary": [
        {**LID, "normal": [-1.0, 0.0, 0.0], "point": [1.0, 0.0, 0.0], "free": [True, False, False], "pressure": 1.0}]}),
     ("boundary 'lid': pressure: expected", "along z")),
    *((title, case({"scene": {"period": [1.0, 0.0]}, "boundary": boundary}), ("boundary 'boundary 1': expected", *words, "axis x"))
      for title, boundary, words in (
        ("plane across a period", {"shape": "plane", "point": [-0.1, 0.0], "normal": [1.0, 0.0]}, ("a normal at right angles",)),
        ("outlet across a period", {"shape": "outlet", "point": [-0.1, 0.0], "normal": [0.1, 1.0]}, ("a normal at right angles",)),
        ("plane that tilts in a period", {**PLANE, "rotation": [0.1]}, ("no rotation but about",)),
        ("segment longer than a period", {"shape": "segment", "point": [0.0, -0.1], "end": [0.98, -0.1]},
         ("a width", "period of 1.000", "or an edge of that length along it, here 1.0")),
        ("segment that turns", {"shape": "segment", "point": [0.0, -0.1], "end": [0.0, 0.88], "rotation": [0.1]}, ("a width",)),
        ("segment round a period that turns", {"shape": "segment", "point": [0.0, -0.1], "end": [1.0, -0.1], "rotation": [0.1]}, ("a width",)),
        ("segment of a period across it", {"shape": "segment", "point": [0.0, -0.1], "end": [0.98, 0.1]}, ("a width",)),
        ("circle larger than a period", {"shape": "circle", "point": [0.5, 0.0], "radius": 0.51}, ("a width", "here 1.020")),
      )),
    *((title, namelist(merged(CASE_3D, {"scene": {"period": [1.0, 0.0, 0.0]}, "boundary": boundary})),
       ("boundary 'boundary 1': expected", words, "axis x"))
      for title, boundary, words in (
        ("oblique cylinder", {"shape": "cylinder", "axis": [1.0, 1.0, 0.0], "radius": 0.3}, "an axis along, or at right angles"),
        ("wide cylinder", {"shape": "cylinder", "axis": [0.0, 1.0, 0.0], "radius": 0.6}, "a width"),
        ("cylinder that tilts", {"shape": "cylinder", "axis": [0.0, 1.0, 0.0], "radius": 0.3, "rotation": [0.0, 0.0, 1.0]},
         "no rotation but about its axis"),
        ("belt that turns", {"shape": "plane", "normal": [0.0, 0.0, 1.0], "rotation": [0.0, 0.0, 1.0]}, "no rotation but about"),
      )),
    # walls of the bodies
    *((f"wall {title}", case({"boundary": boundary}), words) for title, boundary, words in (
        ("without a name", {"shape": "wall"}, ("wall is missing", "required by shape = 'wall'")),
        ("of no side", {"shape": "wall", "wall": "+z"}, ("wall = '+z': expected a side, such as '+x' or '-y', or the identifier of a wall",)),
        ("with a point", {"shape": "wall", "wall": "-x", "point": [0.0, 0.0]}, ("point", "shape = 'wall'")),
        ("that is not there", {"shape": "wall", "wall": "7777"}, ("boundary 'boundary 1' wall = '7777': 0 walls of the bodies are meant; expected one of", "(-x)")),
        ("taken twice by its side and its identifier", [{"shape": "wall", "wall": "-x"}, {"shape": "wall", "wall": "32"}],
         ("expected a wall of its own, but another boundary is the wall 32, too",)),
        ("taken twice", [{"shape": "wall", "wall": "-x"}, {"shape": "wall", "wall": "-x"}], ("a wall of its own, but the 1st has it too",)),
        ("pressed across", {"shape": "wall", "wall": "-x", "free": [False, True], "mass": 1.0, "pressure": 1.0},
         ("0 where no component along normal is free",)))),
    ("wall of no bodies", case({"scene": {"bodies": "none", "lattice_count": None, "radius_min": None, "radius_max": None},
                                "boundary": {"shape": "wall", "wall": "-x"},
                                "insertion": {"lower": [0.0, 0.0], "upper": [1.0, 1.0], "rate": 1.0, "radius": 0.1}}),
     ("another shape where bodies = 'none'",)),
    ("wall of a lattice without walls", case({"scene": {"period": [1.0, 1.0]}, "boundary": {"shape": "wall", "wall": "-x"}}),
     ("boundary 'boundary 1' wall = '-x': expected another shape, since the bodies bring no walls",)),
    # the magnitude
    key("time", "step", "1e-200", "expected a number from 1e-30 to 1e30"),
    key("time", "step", "1e31", "expected a number of at most 1e30 in size"),
    key("scene", "gravity", "0, -1e200", "expected entries of at most 1e30 in size"),
    key("scene", "period_origin", "1e300, 0", "expected entries of at most 1e30 in size", also={"scene": {"period": [1.0, 0.0]}}),
    key("scene", "density", "1e300", "expected a number of at most 1e30 in size"),
    key("scene", "friction", "1e300", "expected a number of at most 1e30 in size"),
    key("scene", "radius_max", "1e200", "expected a number of at most 1e30 in size"),
    key("scene", "radius_min", "1e-200", "expected a number from 1e-30 to 1e30"),
    key("scene", "mass", "1e-200", "expected a number from 1e-30 to 1e30", kind="column"),
    *(boundary_key(name, value, *words, also=also) for name, value, words, also in (
        ("velocity", "1e300, 0", ("entries of at most 1e30 in size",), PLANE),
        ("rotation", "-1e300", ("entries of at most 1e30 in size",), PLANE),
        ("point", "0, 1e300", ("entries of at most 1e30 in size",), {"shape": "plane", "normal": [0.0, 1.0]}),
        ("mass", "1e-300", ("a number from 1e-30 to 1e30",), {**PLANE, "free": [True, False]}),
        ("force", "1e300, 0", ("entries of at most 1e30 in size",), {**PLANE, "free": [True, False], "mass": 1.0}),
        ("radius", "1e-200", ("a number from 1e-30 to 1e30",), {"shape": "circle"}),
        ("end", "1e-200, 0", ("a point at least 1e-30 m from point",), {"shape": "segment"}),
    )),
    ("edge_a = 1e-200", namelist({**CASE_3D, "boundary": {"shape": "rectangle", "edge_a": [1e-200, 0.0], "edge_b": [0.0, 1.0]}}),
     ("edge_a = 1e-200, 0.0", "expected a length of at least 1e-30 m")),
    ("edge_b = 1e-200", namelist({**CASE_3D, "boundary": {"shape": "rectangle", "edge_a": [1.0, 0.0], "edge_b": [0.0, 1e-200]}}),
     ("edge_b = 0.0, 1e-200", "expected a length of at least 1e-30 m")),
    # places that grains of 1 cm cannot tell apart from others
    ("far period", case({"scene": {"period": [1.0, 0.0], "period_origin": [1e20, 0.0]}}),
     ("&scene period_origin: a box as far as 1.000E+20 m", "at most 1.000E+08 m", "1e10 radii of the smallest grain")),
    ("far boundary", case({"boundary": {**PLANE, "point": [0.0, -1e20]}}),
     ("boundary 'boundary 1': a coordinate or length of 1.000E+20 m", "at most 1.000E+08 m")),
    ("huge circle", case({"boundary": {"shape": "circle", "radius": 1e20}}), ("a coordinate or length of 1.000E+20 m",)),
    key("output", "directory", "''", "not empty"),
    # the choice
    key("scene", "bodies", "'cubes'", "'column', 'lattice', 'file', 'sample' or 'none'"),
    key("solver", "method", "'jacobi'", "'nlgs', 'schwarz', 'schwarz_ec', 'nscdd', 'nscdd_ep' or 'newton'"),
    key("solver", "criterion", "'energy'", "'residual' or 'error'"),
    key("solver", "on_failure", "'panic'", "'continue', 'stop' or 'discard'"),
    key("decomposition", "partition", "'scotch'", "'grid' or 'metis'"),
    key("decomposition", "kind", "'mixed'", "'dual' or 'primal'"),
    key("enriched", "interface", "'gmres'", "'mumps' or 'cg'"),
    key("enriched", "interface", "'cg'", "'mumps' where &solver method = 'newton': its interface problem is not symmetric",
        also={"solver": {"method": "newton"}}),
    key("enriched", "contacts", "'some'", "'all' or 'active'"),
    key("enriched", "direction_unit", "'miles'", "'relative' or 'absolute'"),
    # what does not go together
    key("decomposition", "subdomains", "0", ">= 1", also={"solver": {"method": "nscdd"}}),
    key("decomposition", "subdomains", "2", "one subdomain where &solver method = 'nlgs'"),
    key("decomposition", "grid", "2, 1", "one subdomain where &solver method = 'nlgs'"),
    key("decomposition", "subdomains", "31", "the scene is too small for so many subdomains", "expected at most 30",
        also={"solver": {"method": "nscdd"}}),
    key("decomposition", "subdomains", "31", "the scene is too small for so many subdomains", "expected at most 30",
        also={"solver": {"method": "nscdd"}, "decomposition": {"partition": "metis"}}),
    *(key("decomposition", "subdomains", "2000000000", "the scene is too small for so many subdomains", "expected at most 30",
          also={"solver": {"method": "nscdd"}, "decomposition": {"partition": partition}}) for partition in ("grid", "metis")),
    key("decomposition", "subdomains", "4", "expected 6, the product of grid = 2, 3",
        also={"solver": {"method": "nscdd"}, "decomposition": {"grid": [2, 3]}}),
    key("decomposition", "grid", "2, 2", "no grid where partition = 'metis'",
        also={"solver": {"method": "nscdd"}, "decomposition": {"partition": "metis"}}),
    key("solver", "criterion", "'error'", "bodies = 'column' only"),
    key("scene", "column_count", "5", "belongs to bodies = 'column'"),
]

FREE_X = {"free": [True, False], "mass": 1.0}
# title, content of table.csv, keys of the plane that it drives, what the message must have
TABLES = [
    ("vx where x is free", "time,vx\n0,1\n", FREE_X, ("column vx", "'boundary 1'", "no such column where this component is free")),
    ("fy where y is not free", "time,fx,fy\n0,1,1\n", FREE_X, ("column fy", "no such column where this component is not free")),
    ("fx where nothing is free", "time,fx\n0,1\n", {}, ("column fx", "no such column where this component is not free")),
    ("omega where x is free", "time,omega\n0,1\n", FREE_X, ("a rotation rate", "where a component of the translation is free")),
    ("pressure across the free axis", "time,pressure\n0,1\n", FREE_X,
     ("column pressure", "no such column but for a plane of which a component along normal is free")),
    ("pressure where nothing is free", "time,pressure\n0,1\n", {}, ("column pressure", "no such column but for a plane")),
    ("velocity beside vx", "time,vx\n0,1\n", {"velocity": [0.25, 0.5]},
     ("case.nml: &boundary 'boundary 1' velocity: 2.500E-01 along x: expected 0, since the column vx of table.csv replaces it",)),
    ("rotation beside omega", "time,omega\n0,0\n", {"rotation": [-2.0]},
     ("case.nml: &boundary 'boundary 1' rotation: -2.000E+00: expected 0, since the column omega of table.csv replaces it",)),
    ("force beside fx", "time,fx\n0,1\n", {**FREE_X, "force": [3.0, 0.0]},
     ("case.nml: &boundary 'boundary 1' force: 3.000E+00 along x: expected 0, since the column fx of table.csv replaces it",)),
    ("pressure beside its column", "time,pressure\n0,1\n", {"free": [False, True], "mass": 1.0, "pressure": 7.0},
     ("case.nml: &boundary 'boundary 1' pressure: 7.000E+00: expected 0, since the column pressure of table.csv replaces it",)),
    ("speed", "time,vx\n0,0\n1,1e300\n", {}, ("table.csv: table of boundary 'boundary 1': line 3: column vx", '"1e300"', "a number of at most 1e30 in size")),
    ("no number", "time,vx\n0,0\n1,abc\n", {}, ("table.csv: table of boundary 'boundary 1': line 3: column vx: \"abc\"",)),
    ("unknown column", "time,speed\n0,0\n", {}, ("table.csv: table of boundary 'boundary 1': column speed is unknown here",)),
    ("time", "time,vx\n0,0\n1e300,1\n", {}, ("table.csv", "line 3", "column time", '"1e300"', "a number of at most 1e30 in size")),
]

BODIES = """id,x,y,radius,vx,mass,shape,nx,ny
1,0.0,0.1,0.1,0.0,1.0,grain,,
2,0.3,0.1,0.1,0.0,1.0,grain,,
3,0.6,0.1,0.1,0.0,1.0,grain,,
4,0.9,0.1,0.1,0.0,1.0,grain,,
9,0.0,0.0,,,,plane,0.0,1.0
"""


def changed(old, new):
    assert old in BODIES
    return BODIES.replace(old, new)


# title, content of bodies.csv (None: no file), what the message must have
CSV_FILES = [
    ("missing", None, ("No such file",)),
    ("empty", "", ("empty", "names of the columns")),
    ("no column radius", "id,x,y\n1,0,0\n", ("id, x, y, radius", "required", "id,x,y")),
    ("no column y", "id,x,radius\n1,0,1\n", ("id, x, y, radius", "required")),
    ("unknown column", "id,x,y,radius,colour\n1,0,0,1,red\n", ("column colour is unknown in 2D", "known are")),
    ("column of 3D", "id,x,y,z,radius\n1,0,0,0,1\n", ("column z is unknown in 2D",)),
    ("column twice", "id,x,y,x,radius\n1,0,0,0,1\n", ("column x appears twice",)),
    ("id twice", changed("3,0.6", "2,0.6"), ("id 2 appears twice", "unique")),
    ("id of a body and a plane", changed("9,0.0", "4,0.0"), ("id 4 appears twice",)),
    ("id 0", changed("4,0.9", "0,0.9"), ("line 5", "column id", '"0"', "id >= 1")),
    ("id negative", changed("1,0.0,0.1", "-1,0.0,0.1"), ("line 2", "column id", '"-1"', "id >= 1")),
    ("id not whole", changed("4,0.9", "4.5,0.9"), ("line 5", "column id", '"4.5"', "whole number")),
    ("NaN", changed("4,0.9", "4,NaN"), ("line 5", "column x", '"NaN"', "finite number")),
    ("infinity", changed("1,0.0,0.1,0.1,0.0", "1,0.0,0.1,0.1,inf"), ("line 2", "column vx", '"inf"', "finite number")),
    ("too large", changed("4,0.9", "4,1e400"), ("line 5", "column x", '"1e400"', "at most 1.7976931348623157e308 in size")),
    ("text in a number", changed("4,0.9", "4,there"), ("line 5", "column x", '"there"', "finite number")),
    ("a number and more", changed("4,0.9", "4,0.9m"), ("line 5", "column x", '"0.9m"', "finite number")),
    ("no position", changed("4,0.9", "4,"), ("line 5", "column x", "empty")),
    ("radius 0", changed("4,0.9,0.1,0.1", "4,0.9,0.1,0"), ("line 5", "column radius", '"0"', "radius > 0")),
    ("radius negative", changed("1,0.0,0.1,0.1", "1,0.0,0.1,-2"), ("line 2", "column radius", '"-2"', "radius > 0")),
    ("mass 0", changed("4,0.9,0.1,0.1,0.0,1.0", "4,0.9,0.1,0.1,0.0,0"), ("line 5", "column mass", '"0"', "mass > 0")),
    ("mass of some", changed("4,0.9,0.1,0.1,0.0,1.0", "4,0.9,0.1,0.1,0.0,"), ("id 4", "column mass", "for all or for none")),
    ("radius 1e-200", changed("4,0.9,0.1,0.1", "4,0.9,0.1,1e-200"), ("line 5", "column radius", "a number from 1e-30 to 1e30")),
    ("mass 1e200", changed("4,0.9,0.1,0.1,0.0,1.0", "4,0.9,0.1,0.1,0.0,1e200"), ("line 5", "column mass", "from 1e-30 to 1e30")),
    ("speed 1e200", changed("1,0.0,0.1,0.1,0.0", "1,0.0,0.1,0.1,-1e200"), ("line 2", "column vx", "at most 1e30 in size")),
    ("place 1e200", changed("4,0.9", "4,1e200"), ("line 5", "column x", "at most 1e30 in size")),
    ("plane at 1e200", changed("9,0.0,0.0", "9,0.0,1e200"), ("line 6", "column y", "at most 1e30 in size")),
    ("unknown shape", changed("1.0,grain,,\n9", "1.0,cube,,\n9"), ("line 5", "column shape", '"cube"', "grain or plane")),
    ("plane without normal", changed("plane,0.0,1.0", "plane,,"), ("line 6", "column nx", "empty")),
    ("plane with a zero normal", changed("plane,0.0,1.0", "plane,0.0,0.0"), ("line 6", "column nx", "not zero")),
    ("normal of a grain", changed("1.0,grain,,\n9", "1.0,grain,0,1\n9"), ("line 5", "column ny", '"1"', "an empty cell or 0 in the row of a body")),
    ("mass of a plane", changed(",,,plane", ",,5,plane"), ("line 6", "column mass", '"5"', "an empty cell or 0 in the row of a plane")),
    ("speed of a plane", changed(",,,plane", ",-1,,plane"), ("line 6", "column vx", '"-1"', "a plane, which stands still")),
    ("short row", changed("4,0.9,0.1,0.1,0.0,1.0,grain,,", "4,0.9"), ("line 5", "2 cells", "header has 9")),
    ("long row", changed("4,0.9,0.1,0.1,0.0,1.0,grain,,", "4,0.9,0.1,0.1,0.0,1.0,grain,,,"), ("line 5", "10 cells", "9")),
    ("group of no boundary", "id,x,y,radius,group\n1,0.0,0.1,0.1,0\n2,0.3,0.1,0.1,3\n",
     ("id 2: group 3: expected 0, or the group of a &boundary with shape = 'grains' in case.nml",)),
    ("binary", np.random.default_rng(2).bytes(3000), ()),
]

ROWS = {"id": np.arange(1, 6), "position": np.array([[0.3 * k, 0.1] for k in range(5)]), "radius": np.full(5, 0.1),
        "velocity": np.zeros((5, 3)), "mass": np.ones(5)}
WALLS = {"id": np.array([9]), "point": np.zeros((1, 2)), "normal": np.array([[0.0, 1.0]])}


def put(array, place, value):
    array = np.array(array)
    array[place] = value
    return array


# title, changes of /bodies, changes of /walls (a value None takes the dataset out), what the message must have
HDF5_FILES = [
    ("no radius", {"radius": None}, {}, ("/bodies/radius",)),
    ("no id", {"id": None}, {}, ("/bodies/id",)),
    ("unknown dataset", {"colour": np.ones(5)}, {}, ("/bodies/colour", "unknown", "known are")),
    ("id twice", {"id": np.array([1, 2, 3, 4, 2])}, {}, ("id 2 appears twice",)),
    ("id of a body and a plane", {}, {"id": np.array([5])}, ("id 5 appears twice",)),
    ("id 0", {"id": np.array([1, 2, 3, 4, 0])}, {}, ("/bodies/id", "row 4", "0", "id >= 1")),
    ("id 10^18", {"id": np.array([1, 2, 3, 4, 10**18])}, {}, ("/bodies/id", "row 4", "1000000000000000000, but", "at most 18 digits")),
    ("id 2^63 - 1", {"id": np.array([1, 2**63 - 1, 3, 4, 5])}, {}, ("/bodies/id", "row 1", "9223372036854775807 or more", "at most 18 digits")),
    ("unsigned id 2^63 + 5", {"id": np.array([1, 2, 2**63 + 5, 4, 5], "u8")}, {},
     ("/bodies/id", "row 2", "9223372036854775807 or more", "at most 18 digits")),
    ("id 10^18 of a plane", {}, {"id": np.array([10**18])}, ("/walls/id", "row 0", "1000000000000000000, but", "at most 18 digits")),
    ("NaN", {"position": put(ROWS["position"], (4, 0), np.nan)}, {}, ("/bodies/position", "id 5", "NaN", "finite")),
    ("infinity", {"velocity": put(ROWS["velocity"], (0, 2), np.inf)}, {}, ("/bodies/velocity", "id 1", "infinity", "finite")),
    ("radius 0", {"radius": put(ROWS["radius"], 4, 0)}, {}, ("/bodies/radius", "id 5", "> 0")),
    ("mass negative", {"mass": put(ROWS["mass"], 1, -1)}, {}, ("/bodies/mass", "id 2", "> 0")),
    ("radius 1e-200", {"radius": put(ROWS["radius"], 4, 1e-200)}, {}, ("/bodies/radius", "id 5", "from 1e-30 to 1e30")),
    ("radius 1e200", {"radius": put(ROWS["radius"], 4, 1e200)}, {}, ("/bodies/radius", "id 5", "from 1e-30 to 1e30")),
    ("mass 1e200", {"mass": put(ROWS["mass"], 1, 1e200)}, {}, ("/bodies/mass", "id 2", "from 1e-30 to 1e30")),
    ("speed 1e200", {"velocity": put(ROWS["velocity"], (0, 2), -1e200)}, {}, ("/bodies/velocity", "id 1", "at most 1e30")),
    ("place 1e200", {"position": put(ROWS["position"], (4, 0), 1e200)}, {}, ("/bodies/position", "id 5", "at most 1e30")),
    ("plane at 1e200", {}, {"point": np.array([[0.0, 1e200]])}, ("/walls/point", "id 9", "at most 1e30")),
    ("zero normal", {}, {"normal": np.zeros((1, 2))}, ("/walls/normal", "id 9", "not zero")),
    ("three dimensions", {"position": np.zeros((5, 3)), "velocity": np.zeros((5, 6))}, {}, ("/bodies/position",)),
    ("rows missing", {"radius": np.full(4, 0.1)}, {}, ("/bodies/radius", "4 rows", "5")),
    ("text for numbers", {"radius": np.array([b"a"] * 5)}, {}, ("/bodies/radius",)),
    ("reals for ids", {"id": np.arange(1, 6) + 0.5}, {}, ("/bodies/id",)),
]


def write_bodies(path, bodies, walls):
    with h5py.File(path, "w") as file:
        for group, rows in (("bodies", {**ROWS, **bodies}), ("walls", {**WALLS, **walls})):
            for name, value in rows.items():
                if value is not None:
                    file[f"{group}/{name}"] = value
    return path


class BadInput(RunTestCase):
    """Every bad input runs twice: once where nothing was run before, once where an earlier run has left its results, and of
    these once on one rank and once on two."""

    @classmethod
    def setUpClass(cls):
        super().setUpClass()
        run = run_case(CASE, directory=os.path.join(cls.scratch, "earlier"))
        assert run.status == 0, str(run)

    def refuse_all(self, cases, prepare, on_two=1):
        """Run all cases, every `on_two`-th on two ranks as well; `prepare(directory, content)` writes the files of one and gives the name
        that its message has."""
        jobs = [(k, ranks) for k in range(len(cases)) for ranks in (1, 2) if ranks == 1 or k % on_two == 0]
        # a refusal is a second of waiting for the launcher and little work: many side by side
        outcomes = each(lambda k, ranks: self.refuse(k, ranks, cases[k], prepare), jobs, workers=10)
        for (k, ranks), (run, file, problems) in zip(jobs, outcomes):
            title, words = cases[k][0], cases[k][-1]
            with self.subTest(title, ranks=ranks):
                self.assert_refused(run, (file, *words))
                self.assertEqual(problems, [])

    def refuse(self, k, ranks, case, prepare):
        directory = self.here(f"{prepare.__name__}-{k}-{ranks}")
        os.makedirs(directory)
        file = prepare(directory, *case[1:-1])
        results = os.path.join(directory, "results")
        earlier = (k + ranks) % 2 == 0
        if earlier:
            shutil.copytree(self.here("earlier", "results"), results)
        before = snapshot(directory)
        run = gravier("case.nml", ranks=ranks, directory=directory)
        after = snapshot(directory)
        return run, file, sorted(set(before.items()) ^ set(after.items()))

    def assert_refused(self, run, words):
        self.assert_status(run, 2)
        # not splitlines, which takes a few other characters for ends of lines
        self.assertEqual(run.stderr.count("\n"), 1, f"one line expected: {run.stderr!r}")
        self.assertTrue(run.stderr.startswith("gravier: error: "), run.stderr)
        for word in words:
            self.assertIn(word, run.stderr)

    def test_input_files(self):
        def prepare_input(directory, text):
            write(os.path.join(directory, "case.nml"), text)
            return "case.nml"
        self.refuse_all(FILES, prepare_input, 1 if LONG else 5)

    def test_tables(self):
        def prepare_table(directory, text, drive):
            write(os.path.join(directory, "table.csv"), text)
            boundary = {**PLANE, **drive, "table": "table.csv"}
            write(os.path.join(directory, "case.nml"), namelist(merged(CASE, {"boundary": boundary})))
            return "table.csv"
        self.refuse_all(TABLES, prepare_table)

    def test_boundaries_without_grains(self):
        """A lid of glued grains without one, as of a table that has forgotten its groups, flew away with its load in runs that had converged."""
        def prepare_lid(directory, text):
            write(os.path.join(directory, "bodies.csv"), text)
            write(os.path.join(directory, "case.nml"), bodies_case("bodies.csv", boundary=[
                {"name": "lid", "shape": "grains", "group": 2, "free": [False, True], "mass": 1.0}, PLANE]))
            return "case.nml"
        words = ("case.nml: &boundary 'lid': group = 2: bodies.csv has no grain of this group; expected some",)
        self.refuse_all([("no groups", "id,x,y,radius\n1,0,0,0.05\n2,0.3,0,0.05\n", words),
                         ("no grain in it", "id,x,y,radius,group\n1,0,0,0.05,0\n2,0.3,0,0.05,0\n", words)], prepare_lid)

    def test_turning_glued_bodies(self):
        """Glued grains that turn and reach half round a periodic cell, in the rows of the second rank."""
        def prepare_turning(directory, period):
            write(os.path.join(directory, "bodies.csv"), "id,x,y,radius,group\n1,0.1,0,0.05,1\n2,0.3,0,0.05,1\n3,0.55,0,0.05,1\n")
            write(os.path.join(directory, "case.nml"), bodies_case("bodies.csv", period=[period, 0.0], boundary=[
                {"shape": "grains", "group": 1, "pivot": [0.1, 0.0], "rotation": [1.0]}]))
            return "case.nml"
        self.refuse_all([("wide", 1.0, ("boundary 'boundary 1'", "nearer to an image of the pivot than half the period", "axis x"))],
                        prepare_turning)

    def test_far_bodies(self):
        def prepare_far(directory, text, scene):
            write(os.path.join(directory, "bodies.csv"), text)
            write(os.path.join(directory, "case.nml"), bodies_case("bodies.csv", **scene))
            return "case.nml"
        words = ("a coordinate or length of 1.000E+10 m", "at most 1.000E+09 m")
        self.refuse_all([("grain", changed("4,0.9", "4,1e10"), {}, ("id 4", *words)),
                         ("wall", changed("9,0.0,0.0", "9,0.0,-1e10"), {}, ("boundary 'wall 9'", *words)),
                         ("period", BODIES, {"period": [2.0, 0.0], "period_origin": [1e10, 0.0]}, ("period", *words))], prepare_far)

    def test_start_overlap(self):
        """Bodies that lie in each other or behind a boundary; in the message are the worst pair and the limit."""
        def prepare_start(directory, bodies, scene, groups):
            write(os.path.join(directory, "bodies.csv"), "id,x,y,radius,group\n" + bodies)
            write(os.path.join(directory, "case.nml"), namelist(merged({
                "scene": {"bodies": "file", "bodies_file": "bodies.csv", **scene}, "time": CASE["time"], "output": CASE["output"]},
                groups)))
            return "case.nml"
        apart = "5,0,7,0.1,0\n6,3,7,0.1,0\n7,3,0.1,0.1,0\n"
        floor = {"boundary": [{"name": "floor", "shape": "plane", "normal": [0.0, 1.0]}]}
        split = {"solver": {"method": "nscdd"}, "decomposition": {"subdomains": 4}}
        limit = ("&scene start_overlap", "expected at most 50.0 %")
        self.refuse_all([
            ("two disks", "1,0,1,0.1,0\n2,0.2,1,0.2,0\n" + apart, {}, floor,
             ("bodies 1 and 2 overlap by 100.0 % of the smaller radius at the start:", *limit)),
            ("one centre", "1,0,1,0.1,0\n2,0,1,0.1,0\n" + apart, {}, floor, ("bodies 1 and 2 overlap by 200.0 %", *limit)),
            ("two pairs", "1,0,1,0.1,0\n2,0.05,1,0.1,0\n3,3,2,0.1,0\n4,3,2.1,0.1,0\n" + apart, {}, split,
             ("bodies 1 and 2 overlap by 150.0 % of the smaller radius at the start, the most of 2 pairs:", *limit)),
            ("between subdomains", "1,1.46,3.5,0.1,0\n2,1.54,3.5,0.1,0\n" + apart, {}, split, ("bodies 1 and 2 overlap by 120.0 %", *limit)),
            ("in a floor", "1,0,0.04,0.1,0\n" + apart, {}, floor, ("body 1 overlaps boundary 'floor' by 60.0 % of its radius", *limit)),
            ("far behind a floor", "1,0,-5,0.1,0\n" + apart, {}, merged(floor, split),
             ("body 1 overlaps boundary 'floor' by 5100.0 % of its radius", *limit)),
            ("out of a circle", "1,0,3,0.1,0\n", {}, {"boundary": [{"name": "drum", "shape": "circle", "radius": 2.0}]},
             ("body 1 overlaps boundary 'drum' by 1100.0 %", *limit)),
            ("across a period", "1,0.02,1,0.1,0\n2,3.98,1,0.1,0\n" + apart, {"period": [4.0, 0.0]}, split,
             ("bodies 1 and 2 overlap by 160.0 %", *limit)),
            ("in glued disks", "1,0,1,0.1,1\n2,0.1,1,0.1,1\n3,0.15,1.1,0.1,0\n" + apart, {},
             {"boundary": [{"name": "clump", "shape": "grains", "group": 1}]},
             ("bodies 2 and 3 (glued to boundary 'clump') overlap by 88.2 %", *limit)),
            ("a limit of its own", "1,0,1,0.1,0\n2,0.18,1,0.1,0\n" + apart, {"start_overlap": 0.1}, floor,
             ("bodies 1 and 2 overlap by 20.0 %", "expected at most 10.0 %")),
            ("an overlap that grows in the first step", "1,0,1,0.1,0\n2,0.18,1,0.1,0\n" + apart, {"start_overlap": 0.0}, floor,
             ("bodies 1 and 2 overlap by 20.0 %", "expected at most 0.0 %")),
        ], prepare_start)

    def test_starts_that_are_allowed(self):
        """Up to the limit, glued grains in each other, behind an outlet, in a boundary that is taken away at once; and a run that goes
        on from a checkpoint, whatever its places."""
        bodies = "id,x,y,vx,radius,group\n1,0,1,0,0.1,0\n2,0.15,1,0,0.1,0\n3,2,2,0,0.1,1\n4,2.05,2,0,0.1,1\n5,4,-1,0,0.1,0\n"
        groups = {"scene": {"bodies": "file", "bodies_file": "bodies.csv"}, "time": CASE["time"],
                  "output": {**CASE["output"], "checkpoint_every": 1},
                  "boundary": [{"name": "clump", "shape": "grains", "group": 1},
                               {"name": "outlet", "shape": "outlet", "point": [0.0, -3.0], "normal": [0.0, 1.0]},
                               {"name": "gate", "shape": "plane", "normal": [0.0, 1.0], "remove_at": 0.0}]}
        directory = self.here("allowed")
        os.makedirs(directory)
        write(os.path.join(directory, "bodies.csv"), bodies)
        for title, more, words in (("touching", {}, ()), ("one centre", {"start_overlap": 2.0}, ("5,4,-1", "5,0,1")),
                                   ("no overlap", {"start_overlap": 0.0}, ("2,0.15", "2,0.2"))):
            with self.subTest(title):
                write(os.path.join(directory, "bodies.csv"), bodies.replace(*words) if words else bodies)
                for ranks in (1, 2):
                    self.assert_status(run_case(merged(groups, {"scene": more}), ranks, directory), 0)
        # a run that goes on from a checkpoint starts where the one before has ended
        write(os.path.join(directory, "bodies.csv"), bodies.replace("5,4,-1", "5,0,1"))
        self.assert_status(run_case(merged(groups, {"scene": {"start_overlap": 2.0}, "time": {"steps": 1}}), 1, directory), 0)
        self.assert_status(run_case(groups, 2, directory, options=("--restart",)), 0)
        self.assert_refused(run_case(groups, 2, directory), ("bodies 1 and 5 overlap by 200.0 %",))

    def test_csv_bodies(self):
        def prepare_csv(directory, text):
            if text is not None:
                write(os.path.join(directory, "bodies.csv"), text)
            write(os.path.join(directory, "case.nml"), bodies_case("bodies.csv"))
            return "bodies.csv"
        self.refuse_all(CSV_FILES, prepare_csv, 1 if LONG else 3)

    def test_hdf5_bodies(self):
        def prepare_hdf5(directory, bodies, walls):
            write_bodies(os.path.join(directory, "bodies.h5"), bodies, walls)
            write(os.path.join(directory, "case.nml"), bodies_case("bodies.h5"))
            return "bodies.h5"
        self.refuse_all(HDF5_FILES, prepare_hdf5, 1 if LONG else 3)

    def test_broken_hdf5(self):
        whole = write_bodies(self.here("whole.h5"), {}, {})
        with open(whole, "rb") as file:
            whole = file.read()

        def prepare_broken(directory, name, content, scene):
            if content is not None:
                write(os.path.join(directory, name), content)
            write(os.path.join(directory, "case.nml"), bodies_case(name, **scene))
            return name
        self.refuse_all([
            ("missing", "bodies.h5", None, {}, ("No such file",)),
            ("empty", "bodies.h5", b"", {}, ()),
            ("text", "bodies.h5", BODIES, {}, ()),
            ("cut in half", "bodies.h5", whole[:len(whole) // 2], {}, ()),
            ("cut at the end", "bodies.h5", whole[:-100], {}, ()),
            ("overwritten", "bodies.h5", whole[:100] + bytes(600) + whole[700:], {}, ()),
            ("of two dimensions", "bodies.h5", whole, {"dimension": 3}, ("/bodies/position",)),
            ("HDF5 named CSV", "bodies.csv", whole, {}, ()),
            ("unknown ending", "bodies.txt", BODIES, {}, (".h5, .hdf5 or .csv",)),
        ], prepare_broken)

    def test_paths(self):
        def prepare_directory_as_input(directory):
            os.mkdir(os.path.join(directory, "case.nml"))
            return "case.nml"

        def prepare_nothing(directory):
            return "case.nml"
        self.refuse_all([("no file", ("No such file",))], prepare_nothing)
        self.refuse_all([("a directory", ("cannot read",))], prepare_directory_as_input)

    def test_bodies_path_is_a_directory(self):
        def prepare_directory_as_bodies(directory, name):
            os.mkdir(os.path.join(directory, name))
            write(os.path.join(directory, "case.nml"), bodies_case(name))
            return name
        self.refuse_all([(name, name, ()) for name in ("bodies.csv", "bodies.h5")], prepare_directory_as_bodies)

    def test_output_directory(self):
        """Root may write where permissions forbid it, but not below a file or in /proc."""
        def prepare_output(directory, path):
            write(os.path.join(directory, "file"), "a file\n")
            write(os.path.join(directory, "case.nml"), namelist(merged(CASE, {"output": {"directory": path}})))
            return "case.nml"
        self.refuse_all([(path, path, ("&output directory", f"'{path}'", "expected a directory that can be written to"))
                         for path in ("file", "file/below", "/proc/nowhere", "/proc/self")], prepare_output)
        # a check makes no directory, and finds what permissions tell
        for path in ("file", "file/below/that"):
            with self.subTest(path, check=True):
                directory = self.here("check-" + path.replace("/", "-"))
                os.makedirs(directory)
                name = prepare_output(directory, path)
                before = snapshot(directory)
                self.assert_refused(gravier("--check", name, directory=directory),
                                    ("&output directory", f"'{path}'", "nothing can be written there: Not a directory"))
                self.assertEqual(snapshot(directory), before)

    def test_directories_in_the_place_of_outputs(self):
        def prepare_directory(directory, name, output):
            os.makedirs(os.path.join(directory, "out", name))
            write(os.path.join(directory, "case.nml"), namelist(merged(CASE, {"output": {"directory": "out", **output}})))
            return "case.nml"
        self.refuse_all([(name, name, output, ("&output directory = 'out'", f"a directory in it is called {name},"))
                         for name, output in (("run.log", {}), ("history.csv", {}), ("results.h5", {}),
                                              ("final_bodies.h5", {"final_bodies": True}))], prepare_directory)

    def test_inputs_that_the_run_would_replace(self):
        def prepare_input_among_outputs(directory, name, groups):
            os.mkdir(os.path.join(directory, "out"))
            write(os.path.join(directory, "out", name), "a file of mine\n")
            write(os.path.join(directory, "case.nml"), namelist(merged(CASE, {"output": {"directory": "./out/"}}, groups)))
            return "case.nml"
        file = {"bodies": "file", "lattice_count": None, "radius_min": None, "radius_max": None}
        self.refuse_all([(f"{key} {name}", name, groups, (f"{key} = 'out/{name}'", f"its own {name}", "expected a copy in another place"))
                         for key, name, groups in (
            ("&scene bodies_file", "final_bodies.h5", {"scene": {**file, "bodies_file": "out/final_bodies.h5"}, "output": {"final_bodies": True}}),
            ("&scene cell_table", "trace.csv", {"scene": {"cell_table": "out/trace.csv"}, "output": {"trace": True}}),
            ("&scene gravity_table", "history.csv", {"scene": {"gravity_table": "out/history.csv"}}),
            ("&scene shapes", "run.log", {"scene": {**file, "bodies_file": "b.csv", "shapes": "out/run.log"}}),
            ("&boundary 'floor' table", "trace.csv", {"boundary": {**PLANE, "name": "floor", "table": "out/trace.csv"}, "output": {"trace": True}}),
            ("&boundary 'hopper' file", "bodies.vtkhdf", {"boundary": {"shape": "mesh", "name": "hopper", "file": "out/bodies.vtkhdf"},
                                                          "output": {"vtk": True}}),
            ("&insertion 'feed' radius_table", "step_2.hdf5", {
                "insertion": {"name": "feed", "lower": [0.0, 1.0], "upper": [0.1, 1.1], "rate": 1.0, "radii": "table",
                              "radius_table": "out/step_2.hdf5"}, "output": {"fclib_step": 2}}))], prepare_input_among_outputs)

    def test_command_line(self):
        write(self.here("case.nml"), GOOD)
        cases = [((), ("no input file", "--help")),
                 (("--check",), ("no input file",)),
                 (("case.nml", "other.nml"), ("more than one input file", "case.nml and other.nml", "expected one")),
                 (("--check", "--restart", "case.nml"), ("--check beside --restart",)),
                 (("--keys", "case.nml"), ("an input file, case.nml, beside --keys",)),
                 (("--frobnicate", "case.nml"), ("unknown option --frobnicate", "--help")),
                 (("case.nml", "-n", "2"), ("unknown option -n",)),
                 (("--check", "absent.nml"), ("absent.nml", "No such file"))]
        before = snapshot(self.scratch)
        for ranks in (1, 2):
            for arguments, words in cases:
                with self.subTest(arguments, ranks=ranks):
                    self.assert_refused(gravier(*arguments, ranks=ranks, directory=self.scratch), words)
        self.assertEqual(snapshot(self.scratch), before)


def snapshot(directory):
    """What is below a directory: content and time of change of files."""
    found = {}
    for folder, folders, files in os.walk(directory):
        found.update({os.path.join(folder, name): "directory" for name in folders})
        for name in files:
            path = os.path.join(folder, name)
            with open(path, "rb") as file:
                found[path] = (file.read(), os.stat(path).st_mtime_ns)
    return found


if __name__ == "__main__":
    unittest.main()
