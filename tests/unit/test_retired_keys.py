"""Keys and values that scenes no longer have are refused in one line that says what to do instead."""

import pytest

from incipient.errors import SceneError
from incipient.scene import retired
from incipient.scene.file import example, loads


@pytest.mark.parametrize(
    ("override", "message"),
    [
        ("fluid.glow=1", "fluid.glow: is retired; use fluid.reynolds"),
        ('flow.kind="vortex"', 'flow.kind: "vortex" is retired; use flow.kind = "shear"'),
        ('numerics.order="spectral"', 'numerics.order: "spectral" is retired; give 2'),
    ],
)
def test_a_retired_key_names_what_to_write(override, message, monkeypatch):
    monkeypatch.setitem(retired.KEYS, "fluid.glow", "use fluid.reynolds")
    monkeypatch.setitem(retired.VALUES, ("flow.kind", "vortex"), 'use flow.kind = "shear"')
    monkeypatch.setitem(retired.VALUES, ("numerics.order", "spectral"), "give 2")
    with pytest.raises(SceneError) as error:
        loads(example(), overrides=[override])
    assert message in str(error.value)


@pytest.mark.parametrize("key", sorted(retired.KEYS))
def test_no_scene_has_a_retired_key(key):
    with pytest.raises(SceneError) as error:
        loads(example(), overrides=[f"{key}=1"])
    assert f"{key}: is retired; {retired.KEYS[key]}" in str(error.value)
