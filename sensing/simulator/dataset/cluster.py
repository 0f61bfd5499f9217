"""Runs jobs on the workers of a Dask cluster, which are processes of any computers with this version of the toolkit.

    for number, data in results(job, arguments, "tcp://10.0.0.1:8786"):
        ...

A worker of another version, or with another camera module, would hand back other data in silence: it refuses.
"""

from __future__ import annotations

import logging
import time
from collections.abc import Callable, Iterable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from functools import cache
from typing import TYPE_CHECKING, Any, TypeVar

from cad.errors import FileError, ParameterError
from cad.lens import VARIABLE, camera_module
from cad.messages import LOG
from sensing.code_digest import code_digest

if TYPE_CHECKING:
    from distributed import Client

Result = TypeVar("Result")
CONNECT_S = 15  # s, within which a scheduler answers and has a worker
LOOK_S = 0.2  # s, between two looks at what is done
SOURCES = ("cad", "sensing/camera", "sensing/simulator", "sensing/records.py", "sensing/records_labelled.py")
WORKER = "dask worker {address} --nworkers -1 --nthreads 1"


@dataclass(frozen=True)
class Origin:
    """What a computer makes data with, besides the request.

    Attributes:
        code: digest of the code and tables of the simulator.
        camera: the camera module named by the environment, with all its numbers.
    """

    code: str
    camera: str

    @staticmethod
    def here() -> Origin:
        """That of this process."""
        return Origin(_code(), repr(camera_module()))


@cache
def _code() -> str:
    return code_digest(SOURCES)


def results(job: Callable[..., Result], arguments: Iterable[tuple[Any, ...]], address: str) -> Iterator[Result]:
    """Results of ``job(*arguments)``, each when it is finished, in any order.

    Args:
        job: a function at the top level of a module.
        arguments: positional arguments of each call.
        address: of the scheduler, as in ``tcp://10.0.0.1:8786``.

    Raises:
        ParameterError: Dask is not installed, or no scheduler with a worker answers there.
        FileError: a worker is another version of the toolkit or was killed, or the scheduler was lost. Exceptions of a
            job are raised here, too.
    """
    with _client(address) as client:
        from distributed import as_completed

        origin = Origin.here()
        futures = [client.submit(_checked, origin, job, *each, pure=False) for each in arguments]
        running = as_completed(futures, loop=client.loop)
        del futures  # each is given up, with its result on the worker, once it is taken
        alone = False
        while not running.is_empty():
            for future in running.next_batch(block=False):
                with _lost(address):
                    done = future.result()
                yield done
            if not running.has_ready():
                alone = _look(client, address, alone)


def _checked(origin: Origin, job: Callable[..., Result], *arguments: Any) -> Result:
    """On a worker: the result of a call, if it comes from what the asking computer has, too.

    Raises:
        FileError: it would not.
    """
    here = Origin.here()
    if here.code != origin.code:
        raise FileError(
            "a Dask worker has another version of the toolkit, and would make other data: install this version on its "
            "computer and start the worker again"
        )
    if here.camera != origin.camera:
        raise FileError(
            f"a Dask worker has another camera module ({VARIABLE}), and would render other pictures: start the workers "
            "with the same environment"
        )
    return job(*arguments)


@contextmanager
def _client(address: str) -> Iterator[Client]:
    """A connection to a scheduler that has a worker."""
    try:
        from distributed import Client
    except ImportError:
        raise ParameterError(
            f"scheduler={address}: Dask is not installed; run pip install 'endcap-toolkit[cluster]'", name="scheduler"
        ) from None
    for name in ("distributed", "distributed.client"):  # which have levels of their own
        logging.getLogger(name).setLevel(logging.CRITICAL)  # what matters of it is a line of ours
    try:
        client = Client(address, timeout=CONNECT_S, set_as_default=False)
    except (OSError, ValueError, TimeoutError) as error:
        raise ParameterError(
            f"scheduler={address}: no Dask scheduler answers there ({error}); start one with dask scheduler, and "
            "give its address as tcp://HOST:8786",
            name="scheduler",
            value=address,
        ) from error
    with client:
        try:
            client.wait_for_workers(1, timeout=CONNECT_S)
        except TimeoutError:
            raise ParameterError(
                f"scheduler={address}: has no worker; start {WORKER.format(address=address)} on each computer",
                name="scheduler",
                value=address,
            ) from None
        yield client


@contextmanager
def _lost(address: str) -> Iterator[None]:
    """In this context, what ends on the cluster's side is a line."""
    from concurrent.futures import CancelledError

    from distributed import KilledWorker

    try:
        yield
    except KilledWorker as error:
        raise FileError(
            f"scheduler={address}: its workers were killed (out of memory?): the shards there stay readable; run the "
            "same command again, with fewer workers on each computer"
        ) from error
    except CancelledError as error:
        raise _gone(address) from error
    except ModuleNotFoundError as error:
        raise FileError(
            f"scheduler={address}: a worker lacks the toolkit ({error}): install it on its computer and start the "
            "worker again"
        ) from error


def _look(client: Client, address: str, alone: bool) -> bool:
    """Wait a moment; returns whether the scheduler has no worker, and says so when the last one has left.

    Raises:
        FileError: the scheduler is gone.
    """
    time.sleep(LOOK_S)
    if client.status != "running":
        raise _gone(address)
    is_alone = not client.scheduler_info()["workers"]
    if is_alone and not alone:
        LOG.warning(
            f"scheduler={address}: its last worker has left; this run goes on when one joins: "
            f"{WORKER.format(address=address)}"
        )
    return is_alone


def _gone(address: str) -> FileError:
    return FileError(
        f"scheduler={address}: the connection was lost: the shards there stay readable; start the scheduler and its "
        "workers again, then run the same command"
    )
