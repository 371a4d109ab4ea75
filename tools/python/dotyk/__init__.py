"""Scenes of dotyk from Python: write a namelist, run the program, read the results as numpy arrays.

    import dotyk

    scene = dotyk.Scene(title='ball on a block', mesh='hertz.geo')
    scene.material(name='steel', young=210e9, poisson=0.3)
    ...
    results = dotyk.run(scene, output='hertz.vtkhdf', on_progress=print)
    print(results.converged, results.pairs['touch'].pressure.max())

Groups and keys are those of the namelist (docs/input.md, `dotyk --help`): the package knows none of them, and the program refuses
what is wrong, with file and line. Units are those of the input. docs/python.md is the introduction.
"""
import importlib.metadata
import pathlib
import re

from .namelist import Group, NamelistError
from .program import Error, find_program, run
from .results import Body, Cells, Pair, Record, Results
from .scene import Scene


def _version():
    """That of the project in the repository, or else of what is installed."""
    project = pathlib.Path(__file__).resolve().parents[3]/'CMakeLists.txt'
    found = re.search(r'project\(dotyk VERSION (\S+)', project.read_text()) if project.is_file() else None
    return found[1] if found else importlib.metadata.version('dotyk')


__version__ = _version()
__all__ = ['Body', 'Cells', 'Error', 'Group', 'NamelistError', 'Pair', 'Record', 'Results', 'Scene', 'find_program', 'run']
