"""A first picture of a heliostat field, from nothing but the package: run it anywhere, it writes first_plot.png."""

import helio_py as hp
import matplotlib.pyplot as plt
import numpy as np
from helio_py import plot

layout = hp.simulate_field(500, tower_height_m=120.0)
pivots = np.column_stack([layout["east_m"], layout["north_m"], layout["up_m"]])
field = hp.Field(pivots, [0.0, 0.0, 126.0], ids=layout["id"], mirror_offset_m=0.3)

times = np.arange("2026-06-21T05:00", "2026-06-21T20:00", dtype="datetime64[m]")  # UTC
sun = hp.sun_position(times, latitude_deg=37.4, longitude_deg=-6.25, elevation_m=20)
day = hp.track(field, sun.azimuth_rad, sun.elevation_rad)
noon = int(np.argmax(sun.elevation_rad))

figure, (left, right) = plt.subplots(1, 2, figsize=(12, 4.8), layout="constrained")
plot.field_map(field, np.degrees(day.incidence_rad[noon]), label="incidence at noon (°)", ax=left)
plot.day_angles(times, day, rows=[0, 250, 499], ids=field.ids, ax=right)
figure.savefig("first_plot.png", dpi=100)
print(f"{day.shape[0] * day.shape[1]:,} rows, {np.count_nonzero(day.status == hp.Status.OK):,} ok: first_plot.png")
