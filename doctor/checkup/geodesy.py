"""Latitude and longitude as metres east and north, about a place: planar, good to a part in a thousand over some km."""

import numpy as np

SEMI_MAJOR_M = 6378137.0  # WGS 84
ECCENTRICITY_SQUARED = 6.69437999014e-3


def radii(latitude_deg):
    """Metres a radian of latitude, and of longitude."""
    sine = np.sin(np.radians(latitude_deg))
    root = np.sqrt(1.0 - ECCENTRICITY_SQUARED * sine ** 2)
    meridian = SEMI_MAJOR_M * (1.0 - ECCENTRICITY_SQUARED) / root ** 3
    return meridian, SEMI_MAJOR_M / root * np.cos(np.radians(latitude_deg))


def to_plane(lat_deg, lon_deg):
    """Places as complex numbers, east + i north, in m about their median."""
    origin_lat, origin_lon = np.median(lat_deg), np.median(lon_deg)
    north, east = radii(origin_lat)
    turn = (lon_deg - origin_lon + 180.0) % 360.0 - 180.0
    return east * np.radians(turn) + 1j * north * np.radians(lat_deg - origin_lat)
