#!/usr/bin/env python3
"""Writes a made-up weather file: a year of clear, hazy and overcast days in turn. make_epw.py LAT LON ZONE OUT.epw"""

import sys
from datetime import datetime, timedelta
from math import asin, cos, exp, pi, radians, sin

lat, lon, zone = (float(x) for x in sys.argv[1:4])
head = [f"LOCATION,Made up,-,-,-,0,{lat},{lon},{zone},100", "DESIGN CONDITIONS,0", "TYPICAL/EXTREME PERIODS,0"]
head += ["GROUND TEMPERATURES,0", "HOLIDAYS/DAYLIGHT SAVINGS,No,0,0,0", "COMMENTS 1,made up", "COMMENTS 2,none"]
head += ["DATA PERIODS,1,1,Data,Sunday,1/1,12/31"]
lines = []
for index in range(8760):
    begin = datetime(2025, 1, 1) + timedelta(hours=index)
    day = begin.timetuple().tm_yday
    declination = radians(-23.44) * cos(2 * pi * (day + 10) / 365)
    angle = radians(15 * (begin.hour + 0.5 - zone - 12) + lon)
    height = asin(sin(radians(lat)) * sin(declination) + cos(radians(lat)) * cos(declination) * cos(angle))
    clear = [1.0, 0.5, 0.0][day % 3]
    up = max(sin(height), 0.0)
    direct = 950 * clear * exp(-0.13 / up) if up > 0.01 else 0.0
    diffuse = (60 + 180 * (1 - abs(2 * clear - 1))) * up**0.6 + (160 * up if clear == 0 else 0)
    numbers = f"20,10,50,101000,0,0,300,{(direct * up + diffuse):.0f},{direct:.0f},{diffuse:.0f},0,0,0,0"
    lines.append(f"2025,{begin.month},{begin.day},{begin.hour + 1},60,made-up,{numbers}")
open(sys.argv[4], "w", encoding="ascii").write("\n".join(head + lines) + "\n")
