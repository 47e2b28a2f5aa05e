"""The picture of entrainment says which errors its bars hold."""

from pathlib import Path

import pytest

from incipient.pictures.charts.searches import entrainment


@pytest.mark.parametrize(
    ("error", "told"), [(0.001, "all errors"), (None, "known errors, not the flow's")]
)
def test_bars_without_the_error_of_the_flow_are_not_said_to_hold_all(
    error: float | None, told: str
) -> None:
    stored = {
        "title": "",
        "threshold": {"shields": 0.01},
        "curve": [
            {"shields": x, "probability": 10.0 * x, "low": 9.0 * x, "high": 11.0 * x}
            for x in (0.01, 0.02)
        ],
        "quantiles": [
            {
                "shields": 0.01,
                "probability": 0.1,
                "terms": {"law of fluctuations": 0.001},
                "error": error,
            }
        ],
        "data": [],
    }
    words = [
        text.get_text() for text in entrainment(stored, Path()).axes[0].get_legend().get_texts()
    ]
    assert {f"its range by {told}", f"with {told}"} <= set(words)
