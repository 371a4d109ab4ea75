"""Writes a first scene of dotyk from a deck of CalculiX or Abaqus: bodies, rigid ones among them, materials, supports, loads, ties and
contact pairs; several steps become load cases. Parts, instances and assemblies are read as dotyk reads them.

examples: dotyk-convert part.inp                  writes part.nml and part_sets.inp
          dotyk-convert part.inp -o scene.nml     writes scene.nml and scene_sets.inp
          dotyk part.nml                          solves it

Writes SCENE.nml and SCENE_sets.inp beside it: the latter includes the deck and adds sets of the elements of each body, and surfaces for
supports and loads that the deck has on nodes or elements. What could not be carried over is said in comments of SCENE.nml and on the
standard error; exit code 1 then, 2 where nothing could be written.
"""
import argparse
import pathlib
import sys

from .inp2dotyk.deck import Deck
from .inp2dotyk.scene import Scene


def main():
    """Parse and write; the exit code."""
    parser = argparse.ArgumentParser("dotyk-convert", description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("deck", type=pathlib.Path, metavar="DECK.inp", help="deck of CalculiX or Abaqus")
    parser.add_argument("-o", "--output", type=pathlib.Path, metavar="SCENE.nml", help="namelist; default: the deck with the ending .nml, which must not exist")
    arguments = parser.parse_args()
    path = arguments.output or arguments.deck.with_suffix(".nml")
    if not arguments.output and path.exists():
        print("dotyk-convert: %s exists: name the file to write by -o, or remove it" % path, file=sys.stderr)
        return 2
    try:
        scene = Scene(Deck(arguments.deck), path, path.with_name(path.stem + "_sets.inp"))
        scene.write(arguments.deck)
    except (OSError, ValueError, KeyError, IndexError, ZeroDivisionError) as error:
        print("dotyk-convert: %s: %s" % (arguments.deck, error if not isinstance(error, KeyError) else "unknown name %s" % error), file=sys.stderr)
        return 2
    for text in scene.left:
        print("not carried over: " + text, file=sys.stderr)
    return int(bool(scene.left))


if __name__ == "__main__":
    sys.exit(main())
