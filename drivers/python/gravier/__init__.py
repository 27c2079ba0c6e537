"""Results of Gravier as arrays, runs of it from Python, and runs whose loop is the user's.

    import gravier
    run = gravier.Run("out/packing")
    position = run.bodies().position

needs numpy and h5py; `Table.frame()` needs pandas too.
"""
from . import blocks
from .arrays import StaleArray
from .case import CaseError, entries, namelist, parse_namelist, run, value_text
from .checksum import seal
from .fields import Fields, fields, fields_of_states
from .force_networks import contact_forces, force_directions, force_distribution
from .heaps import heap
from .joined_bodies import join_bodies
from .library import SimulationError
from .mixing import mixing
from .outflows import outflow
from .restarts import write_bodies
from .results import BodiesFile, Run
from .rough_walls import rough_walls
from .shapes import Piece, Shape
from .sieves import sieve, sieve_sizes
from .simulation import Simulation
from .studies import study
from .tables import ResultsError, Table, read_table, write_table
from .wall_tests import wall_test

__all__ = ["BodiesFile", "CaseError", "Fields", "Piece", "ResultsError", "Run", "Shape", "Simulation", "SimulationError", "StaleArray", "Table", "blocks",
           "contact_forces", "entries", "fields", "fields_of_states", "force_directions", "force_distribution", "heap", "join_bodies", "mixing", "namelist", "outflow", "parse_namelist", "read_table", "rough_walls", "run", "seal", "sieve", "sieve_sizes", "study",
           "value_text", "wall_test", "write_bodies", "write_table"]
