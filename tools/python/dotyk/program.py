"""Runs of the program."""
import contextlib
import os
import pathlib
import shlex
import shutil
import signal
import subprocess
import threading

from .results import Results
from .scene import Scene, need_folder

MARK = '! Written by dotyk.run.\n'


class Error(Exception):
    """A run without results.

    message: what the program said, such as all mistakes of a namelist with file and line. code: its exit code (docs/messages.md): 1
    stopped before there were results, 2 bad input, 3 not solvable as posed, 4 a file cannot be written, 5 the machine; 128 plus its
    number where a signal ended it; None where the program could not be started. log: what it had printed.
    """

    def __init__(self, message, code=None, log=''):
        super().__init__(message)
        self.message, self.code, self.log = message, code, log


def find_program(program=None, mpi=False):
    """Path of the program: the argument, $DOTYK, build/release/dotyk (mpi: build/mpi/dotyk) of this repository or below the current
    directory, or dotyk of the PATH. Error where there is none."""
    given = program or os.environ.get('DOTYK')
    if given:
        found = shutil.which(given)
        if found is None:
            raise Error('no program %s' % given)
        return found
    build = os.path.join('build', 'mpi' if mpi else 'release', 'dotyk')
    for folder in (pathlib.Path(__file__).resolve().parents[3], pathlib.Path.cwd()):
        found = shutil.which(folder/build)
        if found:
            return found
    found = shutil.which('dotyk')
    if found is None:
        raise Error('no program dotyk: build it (tools/build.sh), or name it in $DOTYK')
    return found


def run(scene, output=None, threads=None, ranks=None, on_progress=None, restart=None, program=None, launcher=None):
    """Run a scene and return its Results; those of a run that did not converge have .converged False.

    scene: a Scene, or the path of a namelist. A Scene is written to the file of its last scene.write, or else beside output with the
    extension .nml; there it replaces only what was written in the same way.
    output: results file; if absent, that of the scene (docs/input.md).
    threads: number of threads (of each rank); all processors if absent.
    ranks: number of ranks, for a program with MPI. launcher: what starts them, such as 'srun -n 4'; 'mpirun --quiet -n RANKS' if absent.
    on_progress: called with each line of the log as it comes, such as print; an exception in it stops the run.
    restart: results file whose contact pressures the scheme starts from.
    program: see find_program.

    Raises Error, with message and exit code, where there are no results. Ctrl-C, SIGTERM and exceptions of on_progress are passed on:
    the program ends its iteration and writes its results, then the exception is raised; a second Ctrl-C after a second ends it at once.
    """
    if ranks is not None and ranks < 1:
        raise ValueError('ranks must be 1 or more, not %r' % ranks)
    words = shlex.split(launcher or ('mpirun --quiet -n %d' % ranks if ranks else ''))
    program = find_program(program, bool(words))
    if words and 'MPI' not in subprocess.run([program, '--version'], capture_output=True, text=True, check=False).stdout:
        raise Error('%s was built without MPI' % program)
    if words and shutil.which(words[0]) is None:
        raise Error('no program %s' % words[0])
    namelist = _namelist_of(scene, output)
    output = pathlib.Path(output or _default_output(namelist))
    before = _identity(output)
    command = [program, os.fspath(namelist), '--output', os.fspath(output)]
    command += ['--threads', str(threads)] if threads is not None else []
    command += ['--restart', os.fspath(restart)] if restart else []
    code, log, message = _follow(words, command, on_progress)
    if code in (0, 1) and _identity(output) not in (None, before):
        return Results(output, log + message)
    if code > 128:
        message += 'ended by signal %d' % (code - 128)
    raise Error(message.strip() or (log.strip().splitlines() or ['exit code %d' % code])[-1].strip(), code, log)


def _namelist_of(scene, output):
    """Path of the namelist of a scene, which is written, or of a path."""
    if not isinstance(scene, Scene):
        return pathlib.Path(scene)
    if scene.path is not None:
        return scene.write(scene.path)
    if output is None:
        raise ValueError('scene.write(path) first, or give output=')
    path = pathlib.Path(output).with_suffix('.nml')
    if path.exists() and not path.read_text(encoding='utf-8', errors='replace').startswith(MARK):
        raise FileExistsError('%s was not written by dotyk.run: scene.write(path) replaces it, or name another output' % path)
    need_folder(path)
    path.write_text(MARK + str(scene), encoding='utf-8', errors='surrogateescape')
    return path


def _default_output(namelist):
    """The results file of a namelist."""
    with contextlib.suppress(OSError, ValueError, KeyError, TypeError):  # the program refuses the file, and says why
        return namelist.parent/Scene.read(namelist).find('scene')['output']
    return namelist.with_suffix('.vtkhdf')


def _identity(path):
    """What tells a results file from the one that replaces it."""
    try:
        status = path.stat()
    except OSError:
        return None
    return status.st_ino, status.st_mtime_ns


def _follow(launcher, command, on_progress):
    """Run, and pass on what interrupts: exit code, log, messages."""
    lines, messages, interrupt = [], [], None
    # A launcher has a session of its own, as a Ctrl-C of the terminal would end its ranks at once.
    with _terminations(), subprocess.Popen([*launcher, *command], stdin=subprocess.DEVNULL, stdout=subprocess.PIPE, text=True,
                                           stderr=subprocess.PIPE, encoding='utf-8', errors='replace',
                                           start_new_session=bool(launcher)) as process:
        reader = threading.Thread(target=lambda: messages.extend(process.stderr), daemon=True)
        reader.start()
        while True:
            try:
                for line in process.stdout:
                    lines.append(line)
                    if on_progress is not None and interrupt is None:
                        on_progress(line.rstrip('\n'))
                process.wait()
                break
            except BaseException as reason:
                interrupt = interrupt or reason
                ask_to_end(process, *launcher[:1])
        reader.join()
    if isinstance(interrupt, _Terminated):
        os.kill(os.getpid(), signal.SIGTERM)
    if interrupt is not None:
        raise interrupt
    code = process.returncode
    return (code if code >= 0 else 128 - code), ''.join(lines), ''.join(messages)


def ask_to_end(process, launcher=''):
    """Ask a run to end with its results. A SIGTERM to mpirun ends the ranks at once, SIGUSR1 reaches them; a SIGTERM to srun kills them,
    and Slurm has sent them theirs already."""
    launcher = os.path.basename(launcher)
    if launcher in ('mpirun', 'mpiexec', 'orterun'):
        process.send_signal(signal.SIGUSR1)
    elif launcher != 'srun':
        process.terminate()


class _Terminated(BaseException):
    """A SIGTERM that would have ended Python."""


@contextlib.contextmanager
def _terminations():
    """Turn SIGTERM into an exception, where nobody else looks after it."""
    if threading.current_thread() is not threading.main_thread() or signal.getsignal(signal.SIGTERM) != signal.SIG_DFL:
        yield
        return

    def terminated(*_):
        raise _Terminated

    signal.signal(signal.SIGTERM, terminated)
    try:
        yield
    finally:
        signal.signal(signal.SIGTERM, signal.SIG_DFL)
