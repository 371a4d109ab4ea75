"""Solid elements: corners, faces and edges, and shape functions of faces."""
import numpy as np

# Corners of the faces S1, S2, ... and of the edges with mid-side nodes, by the number of corners and the dimension (CalculiX manual).
FACES = {(3, 4): "123 142 243 341", (3, 8): "1234 5876 1562 2673 3784 4851", (3, 6): "123 465 1452 2563 3641", (3, 5): "1234 152 253 354 451",
         (2, 3): "12 23 31", (2, 4): "12 23 34 41"}
EDGES = {(3, 4): "12 23 31 14 24 34", (3, 8): "12 23 34 41 56 67 78 85 15 26 37 48", (3, 6): "12 23 31 45 56 64 14 25 36",
         (3, 5): "12 23 34 41 15 25 35 45", (2, 3): "12 23 31", (2, 4): "12 23 34 41"}
CORNERS = {3: {4: 4, 10: 4, 8: 8, 20: 8, 6: 6, 15: 6, 5: 5, 13: 5}, 2: {3: 3, 6: 3, 4: 4, 8: 4}}


def corners(text):
    return [[int(c) - 1 for c in word] for word in text.split()]


def shape_functions(n, s, t):
    """Values and derivatives on tri3, tri6, quad4 and quad8, derivatives by differences that are exact for these polynomials."""
    def values(s, t):
        if n in (3, 6):
            r = 1 - s - t
            return np.array([r, s, t] if n == 3 else [r*(2*r - 1), s*(2*s - 1), t*(2*t - 1), 4*r*s, 4*s*t, 4*t*r])
        at = ((-1, -1), (1, -1), (1, 1), (-1, 1))
        if n == 4:
            return np.array([(1 + a*s)*(1 + b*t)/4 for a, b in at])
        return np.array([(1 + a*s)*(1 + b*t)*(a*s + b*t - 1)/4 for a, b in at] +
                        [(1 - s*s)*(1 - t)/2, (1 + s)*(1 - t*t)/2, (1 - s*s)*(1 + t)/2, (1 - s)*(1 - t*t)/2])
    return values(s, t), (values(s + 1, t) - values(s - 1, t))/2, (values(s, t + 1) - values(s, t - 1))/2
