"""One measured figure beside its reference, measured in the same run."""

from __future__ import annotations

from dataclasses import asdict, dataclass


@dataclass(frozen=True)
class Figure:
    """``ratio`` is value / reference_value: of costs the smaller, of speeds the larger the better."""

    name: str
    value: float
    unit: str
    reference: str
    reference_value: float | None

    @property
    def ratio(self) -> float | None:
        return None if not self.reference_value else self.value / self.reference_value

    def as_dict(self) -> dict[str, object]:
        return {**asdict(self), "ratio": self.ratio}
