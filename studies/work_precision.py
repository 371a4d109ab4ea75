#!/usr/bin/python3
"""Error against cost: runs a grid of cases over a scene, measures errors, draws work-precision diagrams.

usage: studies/work_precision.py GRID.nml      such as studies/grids/wavy.nml

The grid is a namelist file with a group &grid; further &grid groups add points and take from the first what they do not say.
Every combination of the lists is a point of the grid:
  size                         of the mesh, from coarse to fine: numbers, or formulas of the .geo file as texts
  order                        of the elements
  discretization, quadrature, geometry keys of every &contact
  theta_relative, theta, stop_rule, tolerance, scheme, linear_solver      keys of &solver
  theta_default                'yes': no theta is given
  threads
What is absent is as in the scene. Who names one of theta_relative, theta, theta_default means none of the others; so it is with
tolerance and stop_rule.
In the first group:
  scene               namelist file of the scene, relative to the grid's file, as all names (required)
  geometry_parameter  the line of the .geo file that size replaces, such as 'h = 0.1;' ('h'); scale_with: others in proportion
  error               names among errors(path) of check ('check.py' beside the scene), and 'energy': relative energy norm of the
                      error against exact_stress(x, y, z, body) of check, or, where there is none, against a much finer run
  error_label         what to call them on the axes
  reference_size, reference_order, reference_theta_relative      that run (the least theta_relative of the grid if absent)
  repeat (3)          runs of each point: the table has median, least and largest wall time
  limit_seconds (60)  a run that takes longer is stopped; then finer meshes with the same settings are not tried
  max_iterations      of &solver;  without: keys of &solver that are taken out of the scene
  along               what varies along a curve ('size', or the first of tolerance, theta_relative, threads that varies)
  title, output       folder of the results (the name of the grid's file without .nml)

Wall time is dotyk's own total; meshes are made before. The folder gets table.csv, table.h5, figures and report.md, which names
every point that failed or did not converge. An interrupted run goes on where it stopped; points whose inputs, check or executable
changed are run again, all of them where the folder is removed. The executable is $DOTYK, or build/release/dotyk.
"""
import datetime
import difflib
import hashlib
import importlib.util
import itertools
import json
import os
import pathlib
import platform
import re
import shutil
import statistics
import subprocess
import sys
import time

sys.dont_write_bytecode = True
import numpy as np  # noqa: E402

ROOT = pathlib.Path(__file__).resolve().parents[1]
sys.path[:0] = [str(ROOT / 'tools'), str(ROOT / 'tools/python')]
import dotyk  # noqa: E402
import energy_norm  # noqa: E402
import work_precision_report as report  # noqa: E402

CONTACT = {'discretization': str, 'quadrature': str, 'geometry': str}
SOLVER = {'theta_relative': float, 'theta': float, 'stop_rule': str, 'tolerance': float, 'scheme': str, 'linear_solver': str}
DIMENSIONS = {'size': None, 'order': int, **CONTACT, 'theta_default': str, **SOLVER, 'threads': int}
SETTINGS = {'scene': str, 'geometry_parameter': str, 'repeat': int, 'limit_seconds': float, 'check': str, 'title': str,
            'output': str, 'reference_size': None, 'reference_order': int, 'reference_theta_relative': float,
            'max_iterations': int, 'along': str}
EITHER = [('theta_relative', 'theta', 'theta_default'), ('tolerance', 'stop_rule')]  # who says one means none of the others
PARAMETER = r'(?m)(^[ \t]*%s[ \t]*=)([^;\n]+)(?=;)|(^[ \t]*DefineConstant[ \t]*\[[ \t]*%s[ \t]*=)([^\]\n]+)(?=\])'
LISTS = {'error': str, 'error_label': str, 'scale_with': str, 'without': str}


KINDS = {str: 'a text in quotes', int: 'an integer', float: 'a number'}


def said(group, key, kind, many):
    """A key's values (or its only one), None where it is absent; kind None: numbers or texts."""
    if key not in group:
        return None
    values = group.list(key)
    kind = kind or (str if values and isinstance(values[0], str) else float)
    if kind is float:
        values = [float(value) if type(value) is int else value for value in values]
    for value in values:
        if type(value) is not kind:
            group.fail('%s: %r is not %s' % (key, value, KINDS[kind]), key)
    if not values or len(values) > 1 and not many:
        group.fail('%s: %s' % (key, '%d values in place of one' % len(values) if values else 'no value'), key)
    return values if many else values[0]


def check_keys(group, known):
    """Refuse keys that are not among the known ones."""
    for key in group:
        if key not in known:
            near = difflib.get_close_matches(key, known, 1)
            group.fail("unknown key '%s'%s" % (key, " (did you mean '%s'?)" % near[0] if near else ''), key)


class Grid:
    """What the grid's file says."""

    def __init__(self, path):
        self.path = pathlib.Path(path).resolve()
        self.text = self.path.read_text()
        found = dotyk.Scene.parse(self.text, path).groups
        for group in found:
            if group.name != 'grid':
                group.fail('the only group is &grid')
            check_keys(group, [*DIMENSIONS] + ([*SETTINGS, *LISTS] if group is found[0] else []))
        if not found:
            raise dotyk.NamelistError('%s:1: no group &grid' % path)
        first, folder = found[0], self.path.parent
        for key, kind in SETTINGS.items():
            setattr(self, key, said(first, key, kind, False))
        for key, kind in LISTS.items():
            setattr(self, key, said(first, key, kind, True) or [])
        if self.scene is None:
            first.fail('scene is missing')
        self.scene = folder / self.scene
        self.geometry_parameter = self.geometry_parameter or 'h'
        self.repeat = 3 if self.repeat is None else self.repeat
        self.limit_seconds = 60.0 if self.limit_seconds is None else self.limit_seconds
        if self.repeat < 1 or self.limit_seconds <= 0:
            first.fail('repeat is at least 1, limit_seconds above 0')
        self.check = folder / self.check if self.check else self.scene.parent / 'check.py'
        if not self.error:
            first.fail("error is missing: names among errors(path) of check, or 'energy'")
        if self.error_label and len(self.error_label) != len(self.error):
            first.fail('error_label: as many as error', 'error_label')
        self.output = folder / (self.output or self.path.stem)
        self.title = self.title or self.scene.stem
        self.axes, self.points = {}, []
        for group in found:
            lists = {}
            for key, kind in DIMENSIONS.items():
                values = said(group, key, kind, True)
                other = any(name in group for names in EITHER if key in names for name in names if name != key)
                lists[key] = values or (None if other else said(first, key, kind, True)) or [None]
                seen = self.axes.setdefault(key, [])
                seen.extend(value for value in lists[key] if value not in seen)
            for values in itertools.product(*lists.values()):
                point = dict(zip(lists, values))
                if point not in self.points:
                    self.points.append(point)
        self.said = [key for key, values in self.axes.items() if values != [None]]
        self.varying = [key for key, values in self.axes.items() if len(values) > 1]
        self.along = self.along or next((key for key in ('size', 'tolerance', 'theta_relative', 'theta', 'threads')
                                         if key in self.varying), 'size')
        if self.along not in DIMENSIONS:
            first.fail('along: one of %s' % ', '.join(DIMENSIONS), 'along')
        if self.reference_size is not None and self.reference_order is None:
            first.fail('reference_order is missing', 'reference_size')


class Scene:
    """The scene, and how a point of the grid changes it."""

    def __init__(self, grid):
        self.grid, self.text = grid, grid.scene.read_text()
        scene = dotyk.Scene.parse(self.text, str(grid.scene))
        self.dimension = 3 if scene.find('scene').get('analysis', '3d') == '3d' else 2
        self.meshes = [grid.scene.parent / group['mesh'] for group in with_mesh(scene)]  # files in the order in which they are named
        texts = [file.read_text() for file in self.meshes if file.suffix == '.geo']
        for name in [grid.geometry_parameter] + grid.scale_with if 'size' in grid.said else []:
            if all(self.parameter(text, name) is None for text in texts):
                raise ValueError("%s: no line '%s = ...;' in %s" % (grid.path.name, name, ', '.join(f.name for f in self.meshes)))

    def mesh(self, file, size, order):
        """The mesh of a .geo file with this size and order, made if it is not there; other files as they are."""
        if file.suffix != '.geo':
            if size is not None or order is not None:
                raise Omission(None, "%s is not a .geo file: size and order cannot change" % file.name)
            return file
        text = file.read_text()
        grid = self.grid
        if size is not None:
            size = size if isinstance(size, str) else repr(int(size) if size == int(size) else size)
            old = self.parameter(text, grid.geometry_parameter)
            if old is not None:
                text = self.with_parameter(text, grid.geometry_parameter, size)
                for name in grid.scale_with:
                    other = self.parameter(text, name)
                    if other is not None:
                        text = self.with_parameter(text, name, '(%s)*((%s)/(%s))' % (other, size, old))
        if order is not None:
            said = self.parameter(text, 'Mesh.ElementOrder')
            if said is None:
                text = 'Mesh.ElementOrder = %d;\n' % order + text
            else:  # a number, or a name that stands above
                name = said.strip() if self.parameter(text, said.strip()) is not None else 'Mesh.ElementOrder'
                text = self.with_parameter(text, name, '%d' % order)
        text = re.sub(r'(?m)^(\s*(?:Include|Merge)\s+)"([^"]+)"', lambda m: '%s"%s"' % (m[1], file.parent / m[2]), text)
        made = grid.output / 'meshes' / (file.stem + '-' + digest(text) + '.msh')
        if not made.exists():
            made.parent.mkdir(parents=True, exist_ok=True)
            geo = made.with_suffix('.geo')
            geo.write_text(text)
            new = made.with_suffix('.new.msh')
            done = subprocess.run(['gmsh', '-%d' % self.dimension, '-format', 'msh41', '-bin', '-v', '1', '-o', new, geo],
                                  stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True)
            if done.returncode or not new.exists():
                raise Omission(done.returncode, 'gmsh: ' + last_line(done.stdout))
            os.replace(new, made)
        return made

    @staticmethod
    def parameter(text, name):
        """The formula of name in a .geo file: 'name = ...;' or 'DefineConstant[name = ...];'."""
        found = re.search(PARAMETER % (2*(re.escape(name),)), text)
        return (found[2] or found[4]) if found else None

    @staticmethod
    def with_parameter(text, name, formula):
        """The .geo file with another formula of name."""
        return re.sub(PARAMETER % (2*(re.escape(name),)), lambda m: '%s %s' % (m[1] or m[3], formula), text, count=1)

    def case(self, point):
        """The namelist text of a point; its meshes are made."""
        scene = dotyk.Scene.parse(self.text)
        for group, file in zip(with_mesh(scene), self.meshes):
            group['mesh'] = str(self.mesh(file, point['size'], point['order']))
        keys = {key: point[key] for key in SOLVER if point[key] is not None}
        without = list(self.grid.without)
        if 'theta' in keys or 'theta_relative' in keys or point['theta_default'] is not None:
            without += ['theta', 'theta_relative']
            for contact in scene.all('contact'):
                contact.update(theta=None, theta_relative=None)
        if self.grid.max_iterations is not None:
            keys['max_iterations'] = self.grid.max_iterations
        scene.solver(**{**dict.fromkeys(without), **keys})
        for contact in scene.all('contact'):
            contact.update({key: point[key] for key in CONTACT if point[key] is not None})
        return str(scene)


def with_mesh(scene):
    """The groups of a scene that name a mesh."""
    return [group for group in scene.groups if group.name in ('scene', 'body') and 'mesh' in group]


class Omission(Exception):
    """A point that gives no result: exit code (or None) and message."""

    def __init__(self, code, message):
        super().__init__(message)
        self.code, self.message = code, message


def last_line(text):
    """The last line that says something."""
    lines = [line.strip() for line in text.splitlines() if line.strip()]
    return lines[-1] if lines else ''


def digest(*parts):
    """A short name for contents."""
    return hashlib.sha1('\0'.join(map(str, parts)).encode()).hexdigest()[:16]


def run(command, limit):
    """Run one command: exit code (None: out of time), output, seconds."""
    start = time.monotonic()
    process = subprocess.Popen(command, stdin=subprocess.DEVNULL, stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True)
    late = False
    try:
        output = process.communicate(timeout=limit)[0]
    except subprocess.TimeoutExpired:
        late = True
    finally:
        if process.poll() is None:
            process.kill()
            process.communicate()
    return None if late else process.returncode, '' if late else output, time.monotonic() - start


class Study:
    """The grid's runs."""

    def __init__(self, grid, program):
        self.grid, self.program, self.scene = grid, program, Scene(grid)
        self.folder = grid.output / 'points'
        self.folder.mkdir(parents=True, exist_ok=True)
        self.executable = hashlib.sha1(pathlib.Path(program).read_bytes()).hexdigest()
        self.check = self.check_text = None
        if grid.check.exists():
            self.check_text = grid.check.read_text()
            spec = importlib.util.spec_from_file_location('check', grid.check)
            self.check = importlib.util.module_from_spec(spec)
            spec.loader.exec_module(self.check)
        named = [name for name in grid.error if name != 'energy']
        if named and not hasattr(self.check, 'errors'):
            raise ValueError('%s has no function errors(path)' % grid.check)
        self.exact_stress = getattr(self.check, 'exact_stress', None)
        self.reference, self.reference_text = None, ''
        if 'energy' in grid.error and self.exact_stress is None:
            if grid.reference_size is None:
                raise ValueError("error 'energy': %s has no exact_stress, and reference_size is not given" % grid.check)
            self.run_reference()

    def execute(self, case, output, threads, limit):
        """One run of dotyk: exit code and output; Omission where there are no results."""
        output.unlink(missing_ok=True)
        command = [self.program, str(case), '--quiet', '--output', str(output), *(['--threads', str(threads)] if threads else [])]
        code, text, seconds = run(command, limit)
        if code is None:
            output.unlink(missing_ok=True)
            raise Omission(None, 'stopped after limit_seconds=%g' % limit)
        if code not in (0, 1) or not output.exists():
            raise Omission(code, last_line(text).replace(str(self.folder) + '/', '') or 'no message')
        return code, seconds

    def run_reference(self):
        """The much finer run that errors in the energy norm are measured against."""
        grid = self.grid
        thetas = [value for value in grid.axes['theta_relative'] if value is not None]
        theta = grid.reference_theta_relative if grid.reference_theta_relative is not None else min(thetas, default=None)
        point = {**{key: None for key in DIMENSIONS}, 'size': grid.reference_size, 'order': grid.reference_order,
                 'theta_relative': theta, 'tolerance': 1e-10}
        print('reference: %s' % describe(point), flush=True)
        case = self.scene.case(point)
        name = digest(case, self.executable)
        file, output = self.folder / (name + '.nml'), self.folder / (name + '.vtkhdf')
        if not output.exists():
            file.write_text(case)
            try:
                code, _ = self.execute(file, self.folder / 'reference.new', None, 20*grid.limit_seconds)
            except Omission as reason:
                raise ValueError('the reference: %s' % reason.message)
            if code:
                raise ValueError('the reference did not converge')
            os.replace(self.folder / 'reference.new', output)
        self.reference = energy_norm.Results(output)
        self.reference_norm = energy_norm.energy_norm(self.reference)
        self.reference_text = '%s (%d elements)' % (describe(point), self.reference.n_cells)

    def measure(self, output):
        """The errors of a results file and why some are missing."""
        errors, missing = {}, []
        if set(self.grid.error) - {'energy'}:
            try:
                found = self.check.errors(str(output))
                found = found[0] if isinstance(found, tuple) else found
                for name in self.grid.error:
                    if name != 'energy':
                        errors[name] = abs(float(found[name]))
            except Exception as reason:  # whatever check.py does
                missing.append('check.py: %s: %s' % (type(reason).__name__, reason))
        if 'energy' in self.grid.error:
            try:
                if self.exact_stress:
                    found = energy_norm.error(output, self.exact_stress)
                    errors['energy'] = found/energy_norm.energy_norm(output)
                else:
                    errors['energy'] = energy_norm.distance_meshes(output, self.reference)/self.reference_norm
            except (ValueError, KeyError) as reason:
                missing.append('energy: %s' % reason)
        return errors, missing

    def key(self, point, case):
        """A name for what a point depends on."""
        grid = self.grid
        return digest(case, point['threads'], grid.repeat, grid.limit_seconds, self.executable, self.check_text, grid.error,
                      self.reference_text)

    def row(self, point, case):
        """Run a point; its row of the table."""
        row = dict(point, exit=None, converged=0, message='')
        file, output = self.folder / 'running.nml', self.folder / 'running.vtkhdf'
        file.write_text(case)
        try:
            seconds, processes = [], []
            for i in range(self.grid.repeat):
                row['exit'], process = self.execute(file, output, point['threads'], self.grid.limit_seconds)
                with dotyk.Results(output) as results:
                    summary, timing, own = (record.attributes for record in (results.summary, results.timing, results.run))
                    row['elements'] = sum(body.n_cells for body in results.bodies.values())
                seconds.append(timing['total'])
                processes.append(process)
                if i == 0:
                    errors, missing = self.measure(output)
                    row['libraries'] = ', '.join(str(own[name]) for name in ('compiler', 'blas') if name in own)
            for name in ('unknowns', 'constraints', 'iterations', 'body_solves', 'error_bound', 'error_penalty',
                         'error_discretization', 'energy_norm', 'max_penetration'):
                if name in summary:
                    row[name] = summary[name]
            row['functional'] = summary['energy']
            row['scheme_used'], row['converged'] = summary['scheme'], int(summary['converged'])
            row.update(seconds=statistics.median(seconds), seconds_min=min(seconds), seconds_max=max(seconds),
                       seconds_process=statistics.median(processes), repeats=len(seconds))
            row.update({'seconds_' + name: value for name, value in timing.items() if name != 'total'})
            row.update(errors)
            row['message'] = '; '.join(missing)
            if not row['converged']:
                row['message'] = '; '.join(['not converged: error bound %.1e after %d iterations' % (
                    summary['error_bound'], summary['iterations'])] + missing)
        except Omission as omission:
            row['exit'], row['message'] = omission.code, omission.message
        finally:
            for path in (file, output):
                path.unlink(missing_ok=True)
        return row

    def run(self):
        """All points; the rows of the table."""
        grid, rows, start = self.grid, [], time.monotonic()
        made, late, costs = [], set(), {}
        for point in sorted(grid.points, key=lambda p: [grid.axes[key].index(p[key]) for key in ('size', 'order')]):
            try:
                case = self.scene.case(point)
                made.append((point, case, self.folder / (self.key(point, case) + '.json')))
            except Omission as omission:
                rows.append(dict(point, exit=omission.code, converged=0, message=omission.message))
        done = sum(file.exists() for _, _, file in made)
        print('%s: %d points, %d done before, %d runs each; results in %s' % (
            grid.title, len(grid.points), done, grid.repeat, grid.output), flush=True)
        todo = [entry for entry in made if not entry[2].exists()]
        for number, (point, case, file) in enumerate(made, 1):
            series = json.dumps({key: value for key, value in point.items() if key != 'size'})
            if file.exists():
                row = json.loads(file.read_text())
            elif series in late:
                row = dict(point, exit=None, converged=0, message='not tried: out of time on a coarser mesh')
            else:
                print('[%d/%d] %s%s' % (number, len(made), describe(point, grid.varying), self.left(todo, costs)), flush=True)
                before = time.monotonic()
                row = self.row(point, case)
                row['load'] = os.getloadavg()[0]
                costs.setdefault(series, []).append((self.weight(point), time.monotonic() - before))
                write(file, json.dumps(row))
                todo = [entry for entry in todo if entry[0] is not point]
            if row['exit'] is None:
                late.add(series)
            rows.append({**{key: point[key] for key in DIMENSIONS}, **row})
        print('done in %s' % report.duration(time.monotonic() - start), flush=True)
        return rows

    def weight(self, point):
        """What a point costs, as far as the mesh says: bytes of its meshes to the power 1.3."""
        files = {self.scene.mesh(file, point['size'], point['order']) for file in self.scene.meshes}
        return sum(file.stat().st_size for file in files)**1.3

    def left(self, todo, costs):
        """The time left: each series from its own last run, others from the mean."""
        if not costs:
            return ''
        mean = statistics.mean(seconds/weight for runs in costs.values() for weight, seconds in runs[-1:])
        total = 0
        for point, _, _ in todo:
            series = json.dumps({key: value for key, value in point.items() if key != 'size'})
            weight, seconds = costs[series][-1] if series in costs else (1, mean)
            total += min(self.weight(point)*seconds/weight, self.grid.repeat*self.grid.limit_seconds)
        return ', about %s left' % report.duration(total)

    def provenance(self, rows):
        """Machine, versions, git state, date."""
        def said_by(*command):
            try:
                done = subprocess.run(command, cwd=ROOT, text=True, stdout=subprocess.PIPE, stderr=subprocess.STDOUT)
                return done.stdout.strip()
            except OSError as reason:
                return str(reason)

        with open('/proc/cpuinfo') as file:
            model = re.search(r'(?m)^model name\s*:\s*(.*)$', file.read())
        commit = said_by('git', 'rev-parse', 'HEAD')
        facts = {'date': datetime.datetime.now().astimezone().isoformat(timespec='seconds'),
                 'grid': str(self.grid.path.relative_to(ROOT) if self.grid.path.is_relative_to(ROOT) else self.grid.path.name),
                 'cpu': model[1] if model else platform.processor(), 'cores': os.cpu_count(),
                 'memory_gib': round(os.sysconf('SC_PAGE_SIZE')*os.sysconf('SC_PHYS_PAGES')/2**30, 1),
                 'system': platform.platform(), 'dotyk': said_by(self.program, '--version'), 'executable_sha1': self.executable,
                 'gmsh': last_line(said_by('gmsh', '--version')), 'python': platform.python_version(), 'numpy': np.__version__,
                 'git_commit': commit if re.fullmatch('[0-9a-f]{40}', commit) else 'none',
                 'git_dirty': bool(said_by('git', 'status', '--porcelain', '--untracked-files=no'))}
        facts['libraries'] = next((row['libraries'] for row in rows if row.get('libraries')), 'unknown')
        loads = [row['load'] for row in rows if 'load' in row]
        if loads:
            facts['load_average'] = '%.1f to %.1f while running' % (min(loads), max(loads))
        if self.reference_text:
            facts['reference'] = self.reference_text
        return facts


def describe(point, keys=None):
    """A point in words."""
    return ', '.join('%s=%s' % (key, '%g' % value if isinstance(value, float) else value)
                     for key, value in point.items() if value is not None and (keys is None or key in keys))


def write(path, text):
    """Write a file whole or not at all."""
    new = path.with_name(path.name + '.new')
    new.write_text(text)
    os.replace(new, path)


def main():
    if len(sys.argv) != 2 or sys.argv[1] in ('-h', '--help'):
        print(__doc__)
        return 0 if len(sys.argv) == 2 else 2
    program = os.path.abspath(os.environ['DOTYK']) if os.environ.get('DOTYK') else str(ROOT / 'build/release/dotyk')
    if not os.access(program, os.X_OK):
        sys.exit("work_precision: no executable %s; tools/build.sh makes it, or DOTYK names another" % program)
    if shutil.which('gmsh') is None:
        sys.exit('work_precision: gmsh is missing; tools/setup.sh installs it')
    try:
        grid = Grid(sys.argv[1])
        study = Study(grid, program)
        rows = study.run()
        report.write_all(grid, rows, study.provenance(rows))
    except KeyboardInterrupt:
        sys.exit('work_precision: interrupted; the same command goes on')
    except (OSError, ValueError) as reason:
        print('work_precision: %s' % reason, file=sys.stderr)
        return 2
    print('report: %s' % (grid.output / 'report.md'))
    return 0


if __name__ == '__main__':
    sys.exit(main())
