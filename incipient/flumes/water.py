"""Density and viscosity of pure water at atmospheric pressure."""

from ..errors import SceneError

COLDEST, WARMEST = 0.0, 100.0  # degrees Celsius


def require_liquid(temperature: float) -> None:
    """Raise SceneError outside 0 to 100 degrees Celsius."""
    if not COLDEST <= temperature <= WARMEST:
        raise SceneError(
            f"temperature: is {temperature:g} °C; give {COLDEST:g} to {WARMEST:g}, at which water is liquid"
        )


def density_of_water(temperature: float) -> float:
    """Density [kg/m^3] at a temperature [degrees Celsius] (Kell 1975, J. Chem. Eng. Data 20, 97)."""
    t = temperature
    upper = 999.83952 + t * (
        16.945176 - t * (7.9870401e-3 + t * (46.170461e-6 - t * (105.56302e-9 - t * 280.54253e-12)))
    )
    return upper / (1.0 + 16.879850e-3 * t)


def viscosity_of_water(temperature: float) -> float:
    """Kinematic viscosity [m^2/s] at a temperature [degrees Celsius] (IAPWS R12-08, equation 37 at 0.1 MPa)."""
    ratio = (temperature + 273.15) / 300.0
    terms = ((280.68, -1.9), (511.45, -7.7), (61.131, -19.6), (0.45903, -40.0))
    dynamic = 1e-6 * sum(factor * ratio**power for factor, power in terms)
    return dynamic / density_of_water(temperature)
