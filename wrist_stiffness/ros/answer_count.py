"""How many of a run's samples a node has answered, and how long it was silent at most."""

from __future__ import annotations


class AnswerCount:
    """Answers of one node, heard in the order of the samples.

    `first`: number of the first sample that the node was asked.
    """

    def __init__(self, first: int) -> None:
        self._first = first
        self._silence = self._heard = 0
        self.last = first - 1  # number of the newest sample that was answered

    def hear(self, number: int) -> None:
        """Count the answer to a sample by its number."""
        if number > self.last:
            self._silence = self.silence(number)
            self._heard += 1
            self.last = number

    def asked(self, end: int) -> int:
        """Return how many samples before number `end` the node was asked."""
        return end - self._first

    def missing(self, end: int) -> int:
        """Return to how many of these no answer was heard."""
        return self.asked(end) - self._heard

    def silence(self, end: int) -> int:
        """Return how many samples before number `end` were without an answer in a row, at most."""
        return max(self._silence, end - self.last - 1)
