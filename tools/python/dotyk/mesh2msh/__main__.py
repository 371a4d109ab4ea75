"""Converts a mesh to gmsh's format MSH 4.1, binary: what dotyk starts for files of other formats.

usage: python3 tools/python/dotyk/mesh2msh FILE DIMENSION OUT.msh

FILE.inp are decks of Abaqus and CalculiX, FILE.vtu unstructured grids of VTK, FILE.msh meshes of gmsh's format 2.2; other formats are those
that meshio reads. DIMENSION is that of space, 2 or 3. Its lines are those of gmsh: "Info    : Reading 'FILE'...", "Error   : TEXT"; and
"Remark  : TEXT", what the log of dotyk is to say. Needs numpy; other formats need meshio. Exit code 0, or 2 after an error.
"""
import os
import sys
import traceback
import zlib

try:
    import numpy  # noqa: F401, for the message
except ImportError:
    if os.path.exists("/usr/bin/python3") and not os.path.samefile(sys.executable, "/usr/bin/python3"):
        os.execv("/usr/bin/python3", ["/usr/bin/python3", "-B", *sys.argv])
    print("Error   : %s: numpy, which converting meshes needs, is missing: install it (Debian: apt install python3-numpy)" % sys.argv[1])
    sys.exit(2)

# As a package of its own: that of dotyk needs h5py, too. Its other modules are none for others.
sys.path[0] = os.path.dirname(os.path.dirname(os.path.abspath(__file__)))
from mesh2msh import deck, msh, msh22, other, vtu  # noqa: E402
from mesh2msh.mesh import Fault  # noqa: E402

del sys.path[0]


def main(path, dimension, output):
    reader = {".inp": deck, ".vtu": vtu, ".msh": msh22}.get(os.path.splitext(path)[1].lower(), other)
    try:
        mesh, remark, files = reader.read(path, int(dimension))
        for name in files:
            print("Info    : Reading '%s'..." % name)
        fields = ", ".join(dict.fromkeys("'%s'" % name for name, *_ in mesh.fields))
        remark = "; ".join(filter(None, ["fields at nodes: " + fields if fields else "", remark]))
        if remark:
            print("Remark  : %s, read as a mesh: %s" % (path, remark))
        msh.write(output, mesh)
        print("Info    : %d nodes %d elements" % (len(mesh.node_tags), sum(len(block.tags) for block in mesh.blocks)))
    except (Fault, OSError, zlib.error) as error:
        text = str(error)
        print("Error   : %s" % (text if text.startswith(path) or isinstance(error, Fault) else "%s: %s" % (path, text)))
        return 2
    except MemoryError:
        print("Error   : %s: the memory does not suffice to convert it" % path)
        return 2
    except Exception as error:  # what no reader foresaw is told, too, and where
        traceback.print_exc()
        print("Error   : %s: mesh2msh failed at it: %s: %s" % (path, type(error).__name__, error))
        return 2
    return 0


if __name__ == "__main__":
    sys.stdout.reconfigure(errors="surrogateescape")
    if len(sys.argv) != 4:
        sys.exit(__doc__)
    sys.exit(main(*sys.argv[1:]))
