"""Scenes: the groups of one namelist."""
import functools
import itertools
import os
import pathlib

from . import namelist


def need_folder(path):
    """Refuse a file to be written whose folder does not exist."""
    folder = pathlib.Path(path).parent
    if not folder.is_dir():
        raise FileNotFoundError("'%s' cannot be written: there is no folder '%s'; make it first" % (path, folder))


class Scene:
    """A scene, made group by group or read from a namelist.

    Scene(title='ball on a block', mesh='hertz.geo') begins with the keys of &scene; the methods add groups with the keys of
    docs/input.md and return them, as namelist.Group, to be changed later; groups that have no method here are added in the same way:
    scene.temperature(body='ring', value=80). copy.deepcopy(scene) is a scene of its own. Paths that are texts are relative to the namelist that is
    written, those of pathlib to the current directory.

    groups: list of all groups in the order of the file. path: the file that was written last, or None.
    """

    def __init__(self, **keys):
        self.groups, self.path, self._after = [], None, '\n'
        self.add('scene', **keys)

    @classmethod
    def parse(cls, text, file='namelist'):
        """The scene of a namelist text; file: name for messages."""
        scene = cls.__new__(cls)
        scene.path = None
        scene.groups, scene._after = namelist.parse(text, file)
        return scene

    @classmethod
    def read(cls, path):
        """The scene of a namelist file. Comments and layout of what is not changed are kept."""
        with open(path, encoding='utf-8', errors='surrogateescape', newline='') as file:
            return cls.parse(file.read(), os.fspath(path))

    def add(self, group, /, **keys):
        """Add a group with these keys; those that are None are left out. The Group."""
        added = namelist.Group(group, keys)
        added.before = '\n' if self.groups else ''
        self.groups.append(added)
        return added

    def all(self, group, /, **keys):
        """List of the groups of a name, of those that have keys with these values: all('support', body='block')."""
        return [found for found in self.groups if found.name == group
                and all(key in found and found[key] == value for key, value in keys.items())]

    def find(self, group, /, **keys):
        """The only group of a name that has keys with these values: find('body', name='block'). KeyError if there is not one."""
        found = self.all(group, **keys)
        if len(found) != 1:
            words = ''.join(' %s=%r' % item for item in keys.items())
            raise KeyError('%d groups &%s%s in place of one' % (len(found), group, words))
        return found[0]

    def _only(self, group, keys):
        """Change the only group of a name, or add it."""
        if not self.all(group):
            return self.add(group, **keys)
        found = self.find(group)
        found.update(keys)
        return found

    def scene(self, **keys):
        """Change keys of &scene, such as title and mesh. The Group."""
        return self._only('scene', keys)

    def material(self, **keys):
        """Add a &material: name, young [pressure], poisson, ... The Group."""
        return self.add('material', **keys)

    def body(self, **keys):
        """Add a &body: name, volume (a physical group of the mesh), material, ... The Group."""
        return self.add('body', **keys)

    def support(self, **keys):
        """Add a &support: body, surface, fix (directions), value [length], ... The Group."""
        return self.add('support', **keys)

    def load(self, **keys):
        """Add a &load: body, surface, pressure or traction [pressure] or force_density [force/volume], ... The Group."""
        return self.add('load', **keys)

    def contact(self, **keys):
        """Add a &contact: name, surface_a (slave), surface_b (master) as 'body:surface', ... The Group."""
        return self.add('contact', **keys)

    def solver(self, **keys):
        """Add &solver: theta [length/pressure], tolerance, ..., or change it where the scene has one. The Group."""
        return self._only('solver', keys)

    def output(self, **keys):
        """Add &output: fields, error_parts, interval [s], or change it where the scene has one. The Group."""
        return self._only('output', keys)

    def __getattr__(self, group):
        """A function that adds a group of another name; the program refuses those that it does not know."""
        if group.startswith('_'):
            raise AttributeError(group)
        return functools.partial(self.add, group)

    def bodies(self):
        """List of (name, Group) of the bodies in the order of the results file, with all copies that `repeat` makes.

        The first number of repeat is the fastest; the numbers of a copy replace the * of the name.
        """
        copies = []
        for group in self.all('body'):
            name = group['name'].strip()
            for backwards in itertools.product(*(range(1, n + 1) for n in reversed(group.list('repeat')))):
                numbers, parts = [str(n) for n in reversed(backwards)], name.split('*')
                if len(parts) == 2:
                    numbers = [' '.join(numbers)]
                joined = ''.join(itertools.chain(*itertools.zip_longest(parts, numbers, fillvalue='')))
                copies.append((joined if numbers else name, group))
        return copies

    def write(self, path):
        """Write the namelist, over a file that is there; its path, as pathlib.Path."""
        need_folder(path)
        self.path = pathlib.Path(path)
        with open(self.path, 'w', encoding='utf-8', errors='surrogateescape', newline='') as file:
            file.write(str(self))
        return self.path

    def __str__(self):
        """The text of the namelist."""
        text = ''.join(group.before + group.text for group in self.groups) + self._after
        return text if text.endswith('\n') else text + '\n'
