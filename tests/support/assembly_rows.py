"""What a scene of an assembly returns, and the answer of the program or why there is none."""
import collections

# what is measured, its value, what is right, how far they may be apart
Row = collections.namedtuple("Row", "what value right allowed")
CLOSE = 1e-9


class Failed(Exception):
    """The program ended with an exit code."""


def solved(scene, seed=0, dotyk=None, codes=(0,), **options):
    """The answer of a scene; an exception where the program gives none."""
    answer = scene.solve(seed, dotyk, **options)
    if answer.code not in codes:
        raise Failed("exit %d: %s" % (answer.code, answer.error()))
    return answer

PRESS = 1e-3  # pressures
