"""The scenes of benchmarks/large.py: those of inputs/ with the number of unknowns as the only parameter.

scenes()[name](unknowns) gives a Scene. Scene.prepare(folder) lets gmsh write a binary mesh, once; Scene.case(solver) writes the
namelist and gives its path.
"""
import math
import os
import subprocess
import sys

sys.dont_write_bytecode = True
import speed_scenes  # noqa: E402

import dotyk  # noqa: E402


class Scene:
    """A scene of inputs/ with another geometry: its geometry file changed by (old, new), or new values of its parameters."""

    def __init__(self, name, unknowns, folder, changes=(), numbers=None):
        self.name, self.unknowns, self.input, self.changes, self.numbers = name, unknowns, folder, changes, numbers or {}
        self.label = '%s_%s' % (name, size_text(unknowns))

    def prepare(self, folder):
        """Write the mesh unless it is there."""
        self.folder = os.path.join(os.path.abspath(folder), self.label)
        os.makedirs(self.folder, exist_ok=True)
        self.mesh = os.path.join(self.folder, self.label + '.msh')
        source = os.path.join(self.folder, self.label + '.geo')
        text = speed_scenes.replaced(speed_scenes.given(self.input, self.input + '.geo'), self.changes)
        known = os.path.exists(source) and open(source).read() == text and os.path.exists(self.mesh)
        if known:
            return
        speed_scenes.put(source, text)
        made = self.mesh + '.part'
        command = ['gmsh', '-3' if 'plane_strain' not in self.text() else '-2', '-bin', '-format', 'msh41']
        for key, value in self.numbers.items():
            command += ['-setnumber', key, repr(value)]
        ended = subprocess.run([*command, source, '-o', made], capture_output=True, text=True)
        if ended.returncode != 0 or not os.path.exists(made):
            sys.exit('large: gmsh: %s' % (ended.stderr or ended.stdout)[-2000:])
        os.rename(made, self.mesh)

    def text(self):
        """The namelist of inputs/."""
        return speed_scenes.given(self.input, self.input + '.nml')

    def case(self, solver=''):
        """The namelist with other keys of &solver, such as "response='multigrid', tolerance=1e-6"."""
        scene = dotyk.Scene.parse(self.text())
        scene.scene(mesh=self.label + '.msh')
        scene.solver(**dotyk.Scene.parse('&solver %s /' % solver).find('solver'))
        return os.fspath(scene.write(os.path.join(self.folder, 'case.nml')))


def size_text(unknowns):
    """A number of unknowns in thousands, as 172k."""
    return '%.0fk' % (unknowns/1000)


def hertz(unknowns):
    """Sphere on a block: ten elements over the contact radius at every size, finer in depth."""
    return Scene('hertz', unknowns, 'hertz', numbers={'n': 10, 's': 1.0211*(172e3/unknowns)**0.5})


def hertz_contact(unknowns):
    """The same, refined everywhere: the contact rows grow too."""
    return Scene('hertz_contact', unknowns, 'hertz', numbers={'n': 18.1*(unknowns/172e3)**(1/3), 's': 2.5})


def free_stack(unknowns):
    """Eight floating plates."""
    m = max(8, round(8*(unknowns/13e3)**(1/3)))
    return Scene('free_stack', unknowns, 'free_stack', [('m = 8;  ', 'm = %d;  ' % m)])


def bricks(unknowns):
    """Bricks of hexahedra and tetrahedra; the element size divides all lengths."""
    k = max(2, math.ceil(2*(unknowns/41.4e3)**(1/3)))
    return Scene('bricks', unknowns, 'bricks', [('h = 15;', 'h = %r;' % (30/k)), ('H = 35;', 'H = %r;' % (70/k))])


def tunnel(unknowns):
    """Twenty-four segments, placed: three of them are factorized."""
    return Scene('tunnel', unknowns, 'tunnel', numbers={'n': max(1, round(3*(unknowns/88.6e3)**(1/3)))})


def bearing(unknowns):
    """Rings and rollers in plane strain."""
    f = (unknowns/61e3)**0.5
    return Scene('bearing', unknowns, 'bearing', [('h = b/4; ', 'h = b/%r; ' % (4*f)), ('H = r/3; ', 'H = r/%r; ' % (3*f))])


def scenes():
    """Makers of scenes by name."""
    return {make.__name__: make for make in (hertz, free_stack, bricks, tunnel, bearing, hertz_contact)}
