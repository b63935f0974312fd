"""A model that is loaded beside the node's work, for no file may hold the node up or end it."""

from __future__ import annotations

import time
from collections.abc import Callable
from pathlib import Path
from threading import Thread

import numpy as np

from wrist_stiffness.errors import InputError, WristError
from wrist_stiffness.model.error_model import ErrorModel, Load
from wrist_stiffness.model.model_file import load_model
from wrist_stiffness.model.python_laws import python_laws

LOOK_EVERY_S = 0.1


class Loading:
    """One model on its way, in a thread that dies with the process.

    `limit_s`: longest time that may take [s]; `allow_python_laws`: run the Python files that the
    model names.
    """

    def __init__(self, path: Path, limit_s: float, allow_python_laws: bool = False) -> None:
        self.limit_s = limit_s
        self._allowed = allow_python_laws
        self._path = path
        self._model: ErrorModel | None = None
        self._error: WristError | None = None
        self._thread = Thread(target=self._load, daemon=True)
        self._thread.start()

    @property
    def done(self) -> bool:
        """Whether the model is there, or why it is not."""
        return not self._thread.is_alive()

    def wait(self, go_on: Callable[[], bool]) -> None:
        """Wait until it is done, or for as long as it may take and the node is to go on."""
        end = time.monotonic() + self.limit_s
        while not self.done and go_on() and time.monotonic() < end:
            self._thread.join(LOOK_EVERY_S)

    def result(self) -> ErrorModel:
        """Return the model.

        Raises `WristError` if it cannot be loaded, whatever the reason: a model file may name a law
        of the user's own, which is code.
        """
        if not self.done:
            raise InputError(f"{self._path}: not loaded within {self.limit_s:g} s; given up")
        if self._error is not None:
            raise self._error
        if self._model is None:
            raise InputError(f"{self._path}: the law of the model ends the program")
        return self._model

    def _load(self) -> None:
        try:
            if self._path.exists() and not self._path.is_file():
                raise InputError(f"{self._path}: is no regular file")
            with python_laws(self._allowed):
                model = load_model(self._path)
            # The first prediction fills what is computed once.
            model.predict(np.zeros(2), Load(np.zeros(6)))
        except WristError as error:
            self._error = error
        except Exception as error:
            self._error = InputError(f"{self._path}: {type(error).__name__}: {error}")
        else:
            self._model = model
