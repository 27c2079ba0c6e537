"""Pictures of the tables of gravier_measure against time: mixing, heaps, tests between walls, discharge."""
import numpy
from curve_pictures import Panel, draw_panels, label_of

#: by the kind of table: what the rows lie along, and for each panel its label, columns with their names in it, and goals
PANELS = {
    "mixing": ("time", [("mixing", {"mixing": None}, [(1.0, "dealt out at random")]), ("segregation", {"segregation": None}, []),
                        ("height_difference", {"height_difference": None}, [])]),
    "heap": ("time", [("front_low", {"front_low": "low end", "front_high": "high end"}, []), ("length", {"length": "length", "height": "height"}, []), ("run_out", {"run_out": None}, []),
                      ("angle", {"angle_low": "low flank", "angle_high": "high flank", "angle": None}, [])]),
    "walls": ("axial_strain", [("stress", {"axial_stress": "axial", "lateral_stress": "lateral"}, []), ("sin_phi", {"sin_phi": None}, []),
                               ("volumetric_strain", {"volumetric_strain": None}, []), ("void_ratio", {"void_ratio": None}, [])]),
    "outflow": ("time", [("total_left_mass", {"total_left_mass": None}, []), ("mass_rate", {"mass_rate": None}, []), ("number_rate", {"number_rate": None}, [])])}
#: of panels with several columns, and of columns whose names say too little
LABELS = {"front_low": "ends [m]", "length": "size [m]", "angle": "angle [degrees]", "mixing": "mixing M", "sin_phi": "sin φ", "run_out": "run-out", "number_rate": "grains a second [1/s]", "total_left_mass": "mass that has left [kg]",
          "mass_rate": "mass rate [kg/s]"}
#: columns of places, whose axes need not begin at 0
PLACES = ("front_low", "void_ratio")


def draw_measured(kind, table, dimension):
    """A figure of a table of gravier_measure of a kind: a panel for each of its measures."""
    along, groups = PANELS[kind]
    panels = []
    for name, columns, goals in groups:
        # a flank that a heap does not have has no legend
        there = {column: words for column, words in columns.items() if column in table and numpy.isfinite(table[column]).any()}
        if there:
            label = LABELS.get(name) or label_of(name, dimension)
            panels.append(Panel(label, [(table[along], table[column], words) for column, words in there.items()], goals, counts=True, places=name in PLACES))
    return draw_panels(panels, along=label_of(along, dimension))
