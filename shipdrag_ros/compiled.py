# SPDX-License-Identifier: Apache-2.0
"""
How code is compiled, and how it is kept from outliving its source.

numba keeps compiled functions by the file that each is in, but the functions and
constants it uses may be in others. Here a module has a folder, named by a digest
of its source, of the source of all that it imports from this package and of the
compiler: what is in it is always what would be compiled now.
"""

from __future__ import annotations

import contextlib
import hashlib
import logging
import os
import pickle
import re
import shutil
import stat
import sys
import tempfile
import threading
import time
from collections.abc import Callable, Iterator, Mapping
from functools import cache, update_wrapper
from pathlib import Path
from typing import Any, ParamSpec, TypeVar, overload

Arguments = ParamSpec('Arguments')
Result = TypeVar('Result')

CACHE_DIR = 'SHIPDRAG_CACHE_DIR'  # environment
PROCESSOR = 'generic'  # of its kind: the same machine code on every ship's computer
_PACKAGE = Path(__file__).parent
_NAME = _PACKAGE.name
# any mention of a module, which is fast to find, and what is imported from it
_MENTION = re.compile(rb'(%b[.\w]*)(?:[ \t]+import[ \t]+(\([^)]*\)|[^(\n]+))?' % _NAME.encode())
_FOLDER = re.compile(r'(?P<module>[.\w]+)-[0-9a-f]{16}')
_KEPT = 8  # folders of a module: as many versions of its source can take turns
_CHECKED = 32  # bytes of the digest before what is kept
_FORGOTTEN_S = 90 * 86400.0  # not used for so long: its module may be gone
_log = logging.getLogger(__name__)
_not_kept: list[str] = []
_waiting: set[_LazyFunction] = set()
_listeners: list[Callable[[], object]] = []
_importing = threading.Lock()  # numba's modules import each other in a circle


@overload
def compiled(function: Callable[Arguments, Result], /) -> Callable[Arguments, Result]: ...


@overload
def compiled(
    signature: str | None = None,
    /,
    *,
    like: Mapping[str, object] | None = None,
    fastmath: set[str] | bool = False,
    inline: bool = False,
    uncounted: bool = False,
) -> Callable[[Callable[Arguments, Result]], Callable[Arguments, Result]]: ...


def compiled(
    signature: Any = None,
    /,
    *,
    like: Mapping[str, object] | None = None,
    fastmath: set[str] | bool = False,
    inline: bool = False,
    uncounted: bool = False,
) -> Any:
    """
    Compile a function of this package to machine code; it keeps its type.

    The compiler is imported with the first call of any such function: that takes a third of a
    second, which a verb that calls none does not pay.

    Parameters
    ----------
    signature
        Of numba, as text: the function is compiled for this one only, by `compile_all`
        or on its first call. Without it, on the first call with arguments of a type.
    like
        Names in the signature, each with a value whose type it stands for.
    fastmath
        What LLVM may do to floating-point arithmetic.
    inline
        Put the code into each caller.
    uncounted
        For code that is called a million times a second with arrays that Python owns: counting
        the references to them would cost more than the work. Such code cannot make arrays.

    Raises
    ------
    TypeError
        If the function uses variables of a function around it: its source is then not all
        that it depends on.
    """
    if callable(signature):
        return compiled()(signature)

    def decorate(function: Callable[Arguments, Result]) -> Callable[Arguments, Result]:
        if function.__closure__:
            raise TypeError(f'{function.__qualname__}: a compiled function stands in a module')
        options: dict[str, Any] = {'fastmath': fastmath}
        if uncounted:
            options['_nrt'] = False
        if inline:
            options['forceinline'] = True
        result: Callable[Arguments, Result] = _LazyFunction(
            function, options, signature, dict(like or {})
        )
        return result

    return decorate


def compile_all() -> None:
    """
    Compile every function with a signature that is imported, so that no data wait for it.
    """
    while _waiting:
        next(iter(_waiting)).compile_now()


@contextlib.contextmanager
def when_compiling(say: Callable[[], object]) -> Iterator[None]:
    """
    Call something each time that a function is compiled, and not taken from what is kept.
    """
    _listeners.append(say)
    try:
        yield
    finally:
        _listeners.remove(say)


class _LazyFunction:
    """A function before it is needed; it passes every call on to what numba makes of it."""

    def __init__(
        self,
        function: Callable[..., Any],
        options: dict[str, Any],
        signature: str | None,
        like: dict[str, object],
    ) -> None:
        update_wrapper(self, function)
        self._function = function
        self._options = options
        self._signature = signature
        self._like = like
        self._made: Any = None
        self._call: Callable[..., Any] = self._first
        if signature is not None:
            _waiting.add(self)

    def __call__(self, *args: Any, **kws: Any) -> Any:
        """Call it."""
        return self._call(*args, **kws)

    def _first(self, *args: Any, **kws: Any) -> Any:
        self._call = self.compile_now()
        return self._call(*args, **kws)

    def compile_now(self) -> Any:
        """Return what numba makes of it, compiled where a signature says for what."""
        with _importing:  # another thread may do the same
            lock = _numba_lock()
        with lock:
            if self._made is None:
                self._made = _dispatcher(self._function, self._options)
            if self in _waiting:
                _waiting.remove(self)
                if hasattr(self._made, 'compile'):  # else compiling is disabled
                    self._made.compile(_signature_of(self._signature or '', self._like))
                    self._made.disable_compile()
            return self._made

    @property
    def signatures(self) -> list[Any]:
        """What it is compiled for."""
        return [] if self._made is None else list(self._made.signatures)


@cache
def _numba_lock() -> Any:
    """Import numba for one kind of processor, and teach it what a lazy function is."""
    from numba.core import config, event
    from numba.core.compiler_lock import global_compiler_lock
    from numba.extending import typeof_impl

    # also where something else has imported numba before, which then took this machine's features
    config.CPU_NAME = os.environ.setdefault('NUMBA_CPU_NAME', PROCESSOR)
    if config.CPU_NAME == PROCESSOR:
        config.CPU_FEATURES = os.environ.get('NUMBA_CPU_FEATURES', '')

    class Notice(event.Listener):  # type: ignore[misc]
        def on_start(self, event: object) -> None:
            for say in list(_listeners):
                say()

        def on_end(self, event: object) -> None:
            pass

    event.register('numba:compile', Notice())

    @typeof_impl.register(_LazyFunction)
    def _(value: _LazyFunction, context: Any) -> Any:
        return typeof_impl(value.compile_now(), context)

    return global_compiler_lock


@cache
def _say_if_other(features: str) -> None:
    """Warn where numba was used before, and so compiles for a processor of its own choice."""
    from numba.core import config

    if config.CPU_FEATURES not in (None, features):
        _log.warning(
            'numba has compiled code for this processor alone before: the last digits may differ '
            'from those of other processes; use shipdrag_ros before other code of numba'
        )


def _dispatcher(function: Callable[..., Any], options: dict[str, Any]) -> Any:
    import numba

    made = numba.njit(**options)(function)
    if not numba.config.DISABLE_JIT:
        folder = _folder(function.__module__)
        if folder is not None:
            made._cache = _Cache(function, folder)
    return made


def _signature_of(text: str, like: Mapping[str, object]) -> Any:
    """Return a signature as numba reads one, with names of its own."""
    import numba

    names = {name: numba.typeof(value) for name, value in like.items()}
    return eval(text, {'__builtins__': {}}, {**vars(numba.types), **names})


class _Cache:
    """
    What numba compiled of one function, a file for each type of arguments.

    A file is written whole or not at all, and one that is damaged is compiled again.
    """

    def __init__(self, function: Callable[..., Any], folder: Path) -> None:
        self._folder = folder
        self._name = f'{function.__qualname__}-{function.__code__.co_firstlineno}'

    @property
    def cache_path(self) -> str:
        """Where it is kept."""
        return str(self._folder)

    def _path(self, signature: Any, codegen: Any) -> Path:
        arguments = [str(each) for each in _arguments(signature)]
        made_for = codegen.magic_tuple()
        _say_if_other(made_for[2])
        return self._folder / f'{self._name}.{_short(repr((arguments, made_for)))}'

    def load_overload(self, sig: Any, target_context: Any) -> Any:
        """Return what was compiled for a type of arguments, None if nothing."""
        from numba.core import compiler

        target_context.refresh()
        path = self._path(sig, target_context.codegen())
        try:
            kept = path.read_bytes()
        except OSError:
            return None
        data = kept[_CHECKED:]
        if hashlib.sha256(data).digest() != kept[:_CHECKED]:
            return None  # the power failed, or the disk did
        _mark_used(self._folder)
        result = compiler.CompileResult._rebuild(target_context, *pickle.loads(data))
        # types of two modules may have one name
        return result if tuple(result.signature.args) == _arguments(sig) else None

    def save_overload(self, sig: Any, data: Any) -> None:
        """Keep what was compiled for a type of arguments."""
        from numba.core import serialize

        if data.library.has_dynamic_globals:  # addresses, of this process only
            return
        path = self._path(sig, data.codegen)
        content = serialize.dumps(data._reduce())
        try:
            if not self._folder.exists():
                os.makedirs(self._folder, mode=0o700, exist_ok=True)
                _forget_old(self._folder)
            handle, name = tempfile.mkstemp(dir=self._folder)
            try:
                with os.fdopen(handle, 'wb') as file:
                    file.write(hashlib.sha256(content).digest() + content)
                os.replace(name, path)
            except BaseException:
                os.unlink(name)
                raise
        except OSError as error:
            _say_not_kept(f'{self._folder.parent}: {error.strerror}')


def _arguments(signature: Any) -> tuple[Any, ...]:
    """Return the types of the arguments, however the signature is given."""
    from numba.core import sigutils

    return tuple(sigutils.normalize_signature(signature)[0])


def _short(text: str) -> str:
    return hashlib.sha256(text.encode()).hexdigest()[:16]


@cache
def _folder(module: str) -> Path | None:
    """Return where a module's compiled functions are kept; None if nowhere."""
    package, _, name = module.partition('.')
    root = cache_root() if package == _NAME else None
    if root is None:
        return None
    try:
        return root / f'{name}-{digest(module)}'
    except OSError as error:  # a package without its source
        _say_not_kept(f'{_PACKAGE}: {error.strerror}')
        return None


def digest(module: str) -> str:
    """
    Return a digest of all that the compiled functions of a module depend on.

    Notes
    -----
    That is its source, that of the modules of this package that it imports, those that
    they import, and so on, and the compiler.
    """
    reached, left = set(), {module}
    while left:
        each = left.pop()
        reached.add(each)
        left |= read(each)[1] - reached
    return _short(repr((_compiler(), sorted((each, read(each)[0]) for each in reached))))


@cache
def read(module: str) -> tuple[str, frozenset[str]]:
    """
    Return a digest of the source of a module, and the modules of this package it speaks of.
    """
    with open(_file(module), 'rb') as file:
        source = file.read()
    names = set()
    for mention, imported in _MENTION.findall(source):
        base = mention.decode().rstrip('.')
        names.add(base)
        if _file(base).endswith('__init__.py'):
            parts = re.sub(rb'#[^\n]*|[()]', b'', imported).decode().split(',')
            names.update(f'{base}.{part.split()[0]}' for part in parts if part.strip())
    names = {name for name in names if os.path.exists(_file(name))}
    return hashlib.sha256(source).hexdigest(), frozenset(names)


@cache
def _file(module: str) -> str:
    """Return where the source of a module of this package lies."""
    stem = os.path.join(_PACKAGE, *module.split('.')[1:])
    package = os.path.join(stem, '__init__.py')
    return package if os.path.exists(package) else f'{stem}.py'


@cache
def _compiler() -> tuple[object, ...]:
    """Return all else that the machine code depends on, after source and processor."""
    import llvmlite
    import numba
    import numpy as np

    _numba_lock()  # which settles for what processor
    settings = sorted(
        f'{name}={value}'
        for name, value in os.environ.items()
        if name.startswith('NUMBA_') and 'CACHE' not in name and 'THREAD' not in name
    )
    versions = (sys.version, numba.__version__, llvmlite.__version__, np.__version__)
    return (*versions, numba.config.USING_SVML, settings)


@cache
def cache_root() -> Path | None:
    """
    Return the folder that compiled code is kept in; None if none can be written.
    """
    refused = []
    for path, own in _places():
        try:
            os.makedirs(path, mode=0o700, exist_ok=True)
            if own:
                about = path.lstat()
                if not stat.S_ISDIR(about.st_mode) or about.st_uid != os.getuid():
                    raise PermissionError(0, 'it belongs to somebody else')
                path.chmod(0o700)
            tempfile.TemporaryFile(dir=path).close()
        except OSError as error:
            refused.append(f'{path}: {error.strerror}')
        else:
            if refused and CACHE_DIR in os.environ:
                _log.warning('shipdrag: %s is not used (%s) but %s', CACHE_DIR, refused[0], path)
            return path
    _say_not_kept('; '.join(refused))
    return None


def _places() -> Iterator[tuple[Path, bool]]:
    """Yield where compiled code may be kept; True for a place that anybody can make."""
    given = os.environ.get(CACHE_DIR)
    if given:
        yield Path(given).absolute(), False
    user = os.environ.get('XDG_CACHE_HOME', '')
    home = Path(user if os.path.isabs(user) else os.path.expanduser('~/.cache'))
    if home.is_absolute():
        yield home / _NAME, False
    with contextlib.suppress(OSError):  # no such folder at all
        yield Path(tempfile.gettempdir()) / f'{_NAME}-{os.getuid()}', True


def _say_not_kept(why: str) -> None:
    """Say it once."""
    if not _not_kept:
        _not_kept.append(why)
        _log.warning(
            'shipdrag: compiled code is not kept, so that each start takes a minute longer (%s); '
            'set %s to a folder that can be written',
            why,
            CACHE_DIR,
        )


@cache
def _mark_used(folder: Path) -> None:
    with contextlib.suppress(OSError):
        os.utime(folder)


def _forget_old(new: Path) -> None:
    """Remove folders that were not used for longest; links and what is not ours stay."""
    module = new.name.rpartition('-')[0]
    found = []
    for entry in os.scandir(new.parent):
        match = _FOLDER.fullmatch(entry.name)
        if match and entry.is_dir(follow_symlinks=False):
            used = entry.stat(follow_symlinks=False).st_mtime
            found.append((used, match['module'] == module, entry.path))
    versions = sorted((each for each in found if each[1]), reverse=True)
    long_ago = time.time() - _FORGOTTEN_S
    for _, _, path in versions[_KEPT:] + [each for each in found if each[0] < long_ago]:
        shutil.rmtree(path, ignore_errors=True)
