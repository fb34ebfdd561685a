"""The smallest value of a function of whole numbers that costs much and varies smoothly."""

from __future__ import annotations

from collections.abc import Callable, Iterable

__all__ = ["Valley"]


class Valley:
    """Values of `function` at whole numbers `lowest` to `highest`, each computed once and kept in `known`."""

    def __init__(self, function: Callable[[int], float], lowest: int, highest: int) -> None:
        self._function = function
        self._lowest = lowest
        self._highest = highest
        self.known: dict[int, float] = {}

    def fill(self, numbers: Iterable[int]) -> None:
        """Compute the values at those `numbers` that are in range."""
        for number in numbers:
            if self._lowest <= number <= self._highest and number not in self.known:
                self.known[number] = self._function(number)

    def descend(self, number: int, stride: int | None = None) -> int:
        """Return the bottom of the valley that `number` lies in, going in steps of `stride` and then smaller ones."""
        stride = stride or max(number // 8, 1)
        while True:
            around = [n for n in (number - stride, number, number + stride) if self._lowest <= n <= self._highest]
            self.fill(around)
            best = min(around, key=self.known.__getitem__)
            if best == number:
                if stride == 1:
                    return best
                stride = max(stride // 2, 1)
            number = best
