#!/usr/bin/python3
"""Estimated over true discretization errors where estimates are hard: singular corners, thin sheets, jumps of the modulus.

usage: studies/error_estimates.py [--dotyk FILE] [--before FILE] [--only NAME...] [--three] [--shells]

Prints a table in Markdown; with --before that of another executable stands beside it. Scenes: tests/support/estimate_scenes.py;
with --shells instead shells of one layer under pressure and under a punch, tests/support/shell_scenes.py.
"""
import argparse
import pathlib
import sys
import tempfile

ROOT = pathlib.Path(__file__).resolve().parents[1]
sys.path.insert(0, str(ROOT/'tests/support'))
import estimate_scenes  # noqa: E402
import shell_scenes  # noqa: E402
from shell_scenes import energy_norm  # noqa: E402

DIVISIONS = (4, 8)
SLENDERNESS = (20, 200, 1000)


def shells(programs):
    """The rows of shells."""
    for name in shell_scenes.SHAPES:
        for kind in shell_scenes.KINDS:
            for slenderness in SLENDERNESS:
                row = []
                with tempfile.TemporaryDirectory(prefix='dotyk-estimates-') as folder:
                    for n in DIVISIONS:
                        found = [shell_scenes.ratio(folder, program, name, kind, n, slenderness) for program in programs]
                        row.append('%.2g %% | %s' % (100*found[-1][0], ', '.join('%.2g' % of for _, of in found)))
                print('| %s 1:%d | %s | %s |' % (name, slenderness, kind, ' | '.join(row)), flush=True)


def pressed_roofs(programs):
    """A roof of one layer of elements under a punch: against two layers of 32 by 32 hexahedra."""
    print('\n| elements | cells | energy over that of the finest | true error | estimate/true%s |'
          % (' before and now' * (len(programs) > 1)))
    print('|---|---:|---:|---:|---:|')
    with tempfile.TemporaryDirectory(prefix='dotyk-estimates-') as folder:
        finest, finest_norm, _ = shell_scenes.pressed_roof(folder, programs[-1], 'hex27', 32, 2, 10)
        for kind in shell_scenes.KINDS:
            for n in (*DIVISIONS, 16):
                estimates = []
                for program in programs:
                    file, norm, estimate = shell_scenes.pressed_roof(folder, program, kind, n)
                    estimates.append(estimate)
                true = energy_norm.distance_meshes(file, finest)/norm
                print('| %s | %d x %d | %.2f | %.2g %% | %s |' % (kind, n, n, (norm/finest_norm)**2, 100*true, ', '.join(
                    '%.2g' % (estimate/true) for estimate in estimates)), flush=True)


def main():
    """The command line."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument('--dotyk', default=str(ROOT/'build/release/dotyk'), help='executable')
    parser.add_argument('--before', help='another executable, for comparison')
    parser.add_argument('--only', nargs='*', help='names of scenes')
    parser.add_argument('--three', action='store_true', help='elements of three dimensions too')
    parser.add_argument('--shells', action='store_true', help='shells under pressure and under a punch')
    options = parser.parse_args()
    programs = [str(pathlib.Path(program).resolve()) for program in (options.before, options.dotyk) if program]
    print('| scene | elements |' + ''.join(' true error, %d divisions | estimate/true%s |' % (n, ' before and now' * (len(programs) > 1))
                                           for n in DIVISIONS))
    print('|---|---|' + '---:|---:|' * len(DIVISIONS))
    if options.shells:
        shells(programs)
        pressed_roofs(programs)
        return
    for name in options.only or [*estimate_scenes.SCENES, *estimate_scenes.WRAPPED]:
        with tempfile.TemporaryDirectory(prefix='dotyk-estimates-') as folder:
            exact = estimate_scenes.reference(folder, programs[-1], name)
            for kind in estimate_scenes.KINDS_2D + estimate_scenes.KINDS_3D * options.three:
                if name in estimate_scenes.WRAPPED and kind in estimate_scenes.KINDS_3D:
                    continue
                if 'sheet' in name and kind in ('tri3', 'quad4', 'tet4', 'hex8', 'prism6', 'pyramid5'):
                    continue
                row = []
                for n in DIVISIONS:
                    found = [estimate_scenes.ratio(folder, program, name, kind, n, exact) for program in programs]
                    row.append('%.2g %% | %s' % (100*found[-1][0], ', '.join('%.2g' % of for _, of in found)))
                print('| %s | %s | %s |' % (name, kind, ' | '.join(row)), flush=True)


if __name__ == '__main__':
    main()
