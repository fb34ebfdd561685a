"""What is simulated: one frozen value with validated fields."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, ClassVar, Self

from pydantic import BaseModel, ConfigDict, Field, ValidationError

from .errors import InvalidGeometry, InvalidInput
from .words import SHORT, Place, advise, named, say

__all__ = ["Params"]


class Params(BaseModel):
    """Base of every solver's parameters: frozen, finite, nothing unknown, every field with units and meaning.

    `axes` names the scalars that may be swept, set and queried: name -> (field, index or None).
    """

    model_config = ConfigDict(frozen=True, extra="forbid", allow_inf_nan=False, validate_default=True)

    axes: ClassVar[Mapping[str, tuple[str, int | None]]] = {}
    #: Names that a reader of the documents may try, and why there is no such parameter: what to do instead.
    no_axes: ClassVar[Mapping[str, str]] = {}

    seed: int = Field(
        0,
        ge=0,
        lt=2**63,
        description="Seed of everything random in the run",
        json_schema_extra={"units": "1"},
    )

    @classmethod
    def parse(cls, values: Mapping[str, Any]) -> Self:
        """Validate `values`: full field names, and scalar axis names that override single entries.

        Raises:
            InvalidInput: with one sentence per wrong value, or a value that is given by two names.
            InvalidGeometry: when the values contradict each other.

        """
        values = named(values)
        for name in cls.no_axes.keys() & values.keys():
            raise InvalidInput(f"{name!r} cannot be set.", advice=cls.no_axes[name])
        cls.check_given(values)
        plain = {k: v for k, v in values.items() if k not in cls.axes}
        known = {**cls.model_fields, **dict.fromkeys(cls.axes)}
        try:
            unknown = [k for k in plain if k not in known]
            if unknown:
                cls.model_validate({**plain})
            for name, (field, index) in cls.axes.items():
                if name not in values:
                    continue
                if index is None:
                    plain[field] = values[name]
                    continue
                whole = plain.get(field, cls.model_fields[field].default)
                items = list(whole) if isinstance(whole, list | tuple) else whole
                if isinstance(items, list) and index < len(items):
                    items[index] = values[name]
                    plain[field] = items
            return cls.model_validate(plain)
        except ValidationError as error:
            # findings without a place are those of the whole: valid numbers, impossible shape
            whole_only = all(not item["loc"] for item in error.errors())
            kind = InvalidGeometry if whole_only else InvalidInput
            typed: dict[Place, str] = {
                (field,) if index is None else (field, index): name
                for name, (field, index) in cls.axes.items()
                if name in values and name != field
            }
            raise kind(f"{say(error, known, typed)}.", advice=advise(error, typed)) from None

    @classmethod
    def check_given(cls, values: Mapping[str, Any]) -> None:
        """Refuse what cannot be meant, whatever else is said: one value by two names, truth values for numbers.

        Raises:
            InvalidInput: there is such a one.

        """
        names: dict[tuple[str, int | None], str] = {}
        for name, value in values.items():
            other = names.setdefault(cls._place(name), name)
            if other != name:
                raise InvalidInput(f"a value is given twice, as {other} and {name}.", advice="Leave one of them out.")
            several = value if isinstance(value, list | tuple) else (value,)
            if any(isinstance(one, bool) for one in several) and cls._is_number(name):
                raise InvalidInput(
                    f"{name}: a truth value is no number (got {SHORT.repr(value)}).", advice=f"Give {name} a number."
                )

    @classmethod
    def over(cls, base: Mapping[str, Any], values: Mapping[str, Any]) -> dict[str, Any]:
        """Return `base` with `values` over it by whatever names: a field replaces its entries, an axis one of them."""
        said = {cls._place(name) for name in values}
        kept = {k: v for k, v in base.items() if not said & {cls._place(k), (cls._place(k)[0], None)}}
        return {**kept, **values}

    @classmethod
    def _place(cls, name: str) -> tuple[str, int | None]:
        """Return the field that a name means, and which of its entries; None is the whole."""
        return cls.axes.get(name, (name, None))

    @classmethod
    def _is_number(cls, name: str) -> bool:
        """Return whether a name means a number or several, and no truth value."""
        field = cls.model_fields.get(name)
        if name in cls.axes or field is None:
            return name in cls.axes
        usual = field.default if isinstance(field.default, tuple) else ()
        numbers = [one for one in usual if isinstance(one, int | float) and not isinstance(one, bool)]
        return field.annotation in (int, float) or 0 < len(usual) == len(numbers)

    @property
    def keeps_shape(self) -> bool:
        """Whether a run leaves the surface where it is fresh, so that a result without a position has that one."""
        return False

    @classmethod
    def usual(cls) -> dict[str, Any]:
        """Return the defaults of the parameters that have one."""
        return {name: field.default for name, field in cls.model_fields.items() if not field.is_required()}

    def full(self) -> dict[str, Any]:
        """Return all parameters as JSON values, those too that are written only where they are not as usual."""
        return {**self.usual(), **self.model_dump(mode="json")}

    def axis(self, name: str) -> float:
        """Return the scalar behind an axis name, e.g. `axis("te")`."""
        field, index = self.axes[name]
        value = getattr(self, field)
        return float(value if index is None else value[index])
