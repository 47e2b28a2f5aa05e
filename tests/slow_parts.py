"""The slow tests in parts, each under half an hour, by the files that have them.

`python tests/slow_parts.py` prints the parts; with the name of one, or "today", the files of that part.
"""

from __future__ import annotations

import sys
from datetime import UTC, datetime
from pathlib import Path

TESTS = Path(__file__).parent
PARTS = {
    "accuracy": (
        "end_to_end/test_physics.py",
        "end_to_end/test_accuracy.py",
        "end_to_end/test_critical_flow.py",
        "unit/test_accuracy_of_plans.py",
        "unit/test_errorbars.py",
        "unit/test_modelling.py",
        "unit/test_threshold.py",
    ),
    "contact": (
        "unit/test_settle.py",
        "unit/test_touching.py",
        "stability/test_contact_references.py",
        "stability/test_pile.py",
        "stability/test_random_contacts.py",
        "stability/test_siconos.py",
        "unit/test_incipient_motion.py",
    ),
    "motion": (
        "convergence/test_contact_motion.py",
        "convergence/test_coupling.py",
        "convergence/test_rotation.py",
        "end_to_end/test_moving_grain.py",
        "stability/test_moving_mesh.py",
        "unit/test_rigidbody.py",
    ),
    "releases": (
        # The longest first: each file is one process, and the other would wait for it.
        "stability/test_random_releases_with_flow.py",
        "stability/test_random_releases.py",
        "convergence/test_released_steps.py",
        "end_to_end/test_released.py",
        "end_to_end/test_released_sphere.py",
    ),
    "running": (
        "end_to_end/test_pictures.py",
        "unit/test_sampling.py",
        "unit/test_survey.py",
        "end_to_end/test_packages.py",
        "unit/test_parallel.py",
        "unit/test_solids.py",
        "end_to_end/test_command_line.py",
        "end_to_end/test_demos.py",
        "end_to_end/test_effects_of_scenes.py",
        "end_to_end/test_environments.py",
        "end_to_end/test_failure.py",
        "end_to_end/test_results.py",
        "end_to_end/test_survey_command.py",
        "end_to_end/test_sweeps.py",
        "stability/test_flow.py",
        "stability/test_hard_cases.py",
        "stability/test_random_files.py",
        "stability/test_random_scenes.py",
        "unit/test_scene_file.py",
    ),
    "sand": (
        "end_to_end/test_sand_in_space.py",
        "end_to_end/test_same_run.py",
    ),
    "space": (
        "unit/test_meshes.py",
        "convergence/test_space.py",
        "end_to_end/test_pebble.py",
        "end_to_end/test_runs_in_space.py",
        "end_to_end/test_moving_in_space.py",
        "unit/test_meshing_in_space.py",
        "unit/test_scene.py",
    ),
    "stones": (
        "end_to_end/test_large_grain.py",
        "end_to_end/test_large_grain_in_space.py",
        "end_to_end/test_moving_stone.py",
    ),
    "turbulence": (
        "end_to_end/test_resolved_channels.py",
        "end_to_end/test_hump.py",
        "end_to_end/test_rough_beds.py",
        "end_to_end/test_turbulent_channels.py",
        "unit/test_turbulence.py",
    ),
    "unsteady": (
        "end_to_end/test_gusts.py",
        "end_to_end/test_oscillating_flow.py",
        "convergence/test_channels.py",
        "convergence/test_time.py",
        "convergence/test_waves.py",
        "end_to_end/test_free_surface.py",
        "end_to_end/test_open_channels.py",
    ),
}


def of_day(day: int) -> str:
    """The part whose turn it is on a day of the year: each comes round every ten days."""
    return sorted(PARTS)[day % len(PARTS)]


def files(part: str) -> list[str]:
    """The files of a part, or of all parts for an empty name, relative to the working directory where that is above.

    Raises KeyError for a part that there is not.
    """
    names = PARTS[part] if part else [name for names in PARTS.values() for name in names]
    return [str(TESTS / name) for name in names]


def main() -> None:
    """Print the parts, or the files of one; exit with a line that names the parts for another name."""
    match sys.argv[1:]:
        case []:
            print(" ".join(sorted(PARTS)))
        case ["today"]:
            print(of_day(datetime.now(UTC).timetuple().tm_yday))
        case [part] if part == "all" or part in PARTS:
            print(" ".join(files("" if part == "all" else part)))
        case other:
            sys.exit(
                f"PART: {' '.join(other)}: there is no such part; use one of {', '.join(sorted(PARTS))}, all"
            )


if __name__ == "__main__":
    main()
