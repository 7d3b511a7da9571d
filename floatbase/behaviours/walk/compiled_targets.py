"""All targets of a `Walk` from arrays, compiled: the same numbers as the functions in `targets`.

Between two changes of stance, a walk is four arrays. `body` holds the path, the desired motion and
the base's target. `pieces` holds the closed form of the plan of the centre of mass. `swings` has
one row for each foot in the air. `write_targets` moves the path, aims the swings and writes the
targets of one control step.
"""

from __future__ import annotations

import numpy as np

from floatbase.control.tick.jit import jit_cached

# entries of `body`, (BODY_SIZE,); the path and the desired motion are those of `path`
TIME, POSITION, YAW, VELOCITY = 0, 1, 3, 4
FIRST, LATER, FIRST_UNTIL, BEGIN, ACCELERATION = 7, 10, 13, 14, 15
OMEGA, COM_HEIGHT, GROUND, DEAD_ZONE, REACH, SIDE_FRACTION = 18, 19, 20, 23, 24, 25
COM_ENTRY, BASE_ENTRY, BASE_ROTATION = 26, 27, 28
PITCH, LEAN_BEGIN, LEAN, BODY_SIZE = 37, 38, 39, 42
# columns of `swings`, (n, SWING_SIZE)
START, PLANNED_END, END, LIFT_OFF, TOUCHDOWN, CLEARANCE = 0, 3, 5, 8, 9, 10
NOMINAL, LANDING, FIRST_YAW, YAW_CHANGE, FIRST_TILT, TILT_CHANGE = 11, 14, 17, 18, 19, 21
FOOT_ROTATION, POSITION_ENTRY, ROTATION_ENTRY, SWING_SIZE = 23, 32, 33, 34
PIECE_SIZE = 9  # begin, then p, its slope, the coefficients a and b, (2,) each
_MAX_EXPONENT_COM, _MAX_EXPONENT_STEP = 300.0, 50.0  # as in `lipm` and `footholds`
_LEAN_RATE = 15.0  # 1/s, as in `targets`


def make_write_targets(digest):
    """Return the function `write_targets`, to be compiled; digest: of the tick's folder."""

    def write_targets(t, com, com_velocity, body, pieces, swings, out):
        """Write the targets of all tasks at t [s] into `out`.

        The path in `body` moves to t, and the ends in `swings` are shifted. com, com_velocity:
        (3,), world. The rotation of a ball foot has the entry -1 and is not written.
        """
        _ = digest  # makes it part of numba's cache key
        # path
        goal = FIRST if t < body[FIRST_UNTIL] else LATER
        duration = max(0.0, t - max(body[TIME], body[BEGIN]))
        x, y, turn = 0.0, 0.0, 0.0
        for i in range(3):
            before, limit = body[VELOCITY + i], body[ACCELERATION + i]
            change = body[goal + i] - before
            ramp = min(duration, abs(change) / limit)
            after = before + np.sign(change) * limit * ramp
            displacement = (before + after) / 2.0 * ramp + after * (duration - ramp)
            body[VELOCITY + i] = after
            if i == 0:
                x = displacement
            elif i == 1:
                y = displacement
            else:
                turn = displacement
        heading = body[YAW] + turn / 2.0
        c, s = np.cos(heading), np.sin(heading)
        body[POSITION] += c * x - s * y
        body[POSITION + 1] += s * x + c * y
        body[YAW] += turn
        body[TIME] = t

        # centre of mass
        omega, piece = body[OMEGA], pieces.shape[0] - 1
        time = max(t, pieces[0, 0])
        while piece > 0 and pieces[piece, 0] > time:
            piece -= 1
        time -= pieces[piece, 0]
        growth = np.exp(min(omega * time, _MAX_EXPONENT_COM))
        at, error_x, error_y = int(body[COM_ENTRY]), 0.0, 0.0
        for i in range(2):
            slope = pieces[piece, 3 + i]
            p = pieces[piece, 1 + i] + slope * time
            up, down = pieces[piece, 5 + i] * growth, pieces[piece, 7 + i] / growth
            out[at + i] = p + up + down
            out[at + 3 + i] = slope + omega * (up - down)
            out[at + 6 + i] = omega * omega * (up + down)
            dcm = p + slope / omega + 2.0 * up
            error = com[i] + com_velocity[i] / omega - dcm
            if i == 0:
                error_x = error
            else:
                error_y = error
        for i in range(3):
            height = body[GROUND] * out[at + 3 * i] + body[GROUND + 1] * out[at + 3 * i + 1]
            out[at + 3 * i + 2] = height
        out[at + 2] += body[COM_HEIGHT] + body[GROUND + 2]

        # base: the lean is e^{-rate s} (a + b s + c s²)
        s = max(t - body[LEAN_BEGIN], 0.0)
        decay, slope = np.exp(-_LEAN_RATE * s), body[LEAN + 1] + 2.0 * body[LEAN + 2] * s
        value = body[LEAN] + body[LEAN + 1] * s + body[LEAN + 2] * s * s
        rate = decay * (slope - _LEAN_RATE * value)
        bend = decay * (2.0 * body[LEAN + 2] - 2.0 * _LEAN_RATE * slope + _LEAN_RATE**2 * value)
        pitch, turning, at = body[PITCH] + decay * value, body[VELOCITY + 2], int(body[BASE_ENTRY])
        pitch_c, pitch_s = np.cos(pitch), np.sin(pitch)
        c, s = np.cos(body[YAW]), np.sin(body[YAW])
        for j in range(3):
            b0, b2 = body[BASE_ROTATION + j], body[BASE_ROTATION + 6 + j]
            r0, r1 = pitch_c * b0 + pitch_s * b2, body[BASE_ROTATION + 3 + j]
            out[at + j], out[at + 3 + j] = c * r0 - s * r1, s * r0 + c * r1
            out[at + 6 + j] = pitch_c * b2 - pitch_s * b0
        out[at + 9], out[at + 10], out[at + 11] = -rate * s, rate * c, turning
        out[at + 12] = -bend * s - rate * turning * c
        out[at + 13] = bend * c - rate * turning * s
        out[at + 14] = 0.0

        # feet in the air
        size = np.sqrt(error_x * error_x + error_y * error_y)
        scale = max(0.0, size - body[DEAD_ZONE]) / (size if size > 0.0 else 1.0)
        for m in range(swings.shape[0]):
            swing = swings[m]
            left = swing[TOUCHDOWN] - t
            factor = scale * np.exp(min(omega * max(left, 0.0), _MAX_EXPONENT_STEP))
            body_x = com[0] + com_velocity[0] * left
            body_y = com[1] + com_velocity[1] * left
            x = swing[PLANNED_END] + factor * error_x - body_x
            y = swing[PLANNED_END + 1] + factor * error_y - body_y
            nominal_x, nominal_y = swing[NOMINAL], swing[NOMINAL + 1]
            along, aside = c * x + s * y - nominal_x, -s * x + c * y - nominal_y
            length = np.sqrt(along * along + aside * aside)
            fraction = min(1.0, body[REACH] / (length if length > 0.0 else 1.0))
            along, aside = nominal_x + along * fraction, nominal_y + aside * fraction
            side = np.copysign(1.0, nominal_y)
            aside = side * max(side * aside, body[SIDE_FRACTION] * abs(nominal_y))
            swing[END] = body_x + c * along - s * aside
            swing[END + 1] = body_y + s * along + c * aside
            level = swing[LANDING] * swing[END] + swing[LANDING + 1] * swing[END + 1]
            swing[END + 2] = swing[NOMINAL + 2] + (level + swing[LANDING + 2])
            period = swing[TOUCHDOWN] - swing[LIFT_OFF]
            u = min(max((t - swing[LIFT_OFF]) / period, 0.0), 1.0)
            w = u * (1.0 - u)
            position = u**3 * (10.0 - 15.0 * u + 6.0 * u * u)
            velocity = 30.0 * w * w / period
            acceleration = 60.0 * w * (1.0 - 2.0 * u) / period**2
            at = int(swing[POSITION_ENTRY])
            for i in range(3):
                way = swing[END + i] - swing[START + i]
                out[at + i] = swing[START + i] + position * way
                out[at + 3 + i], out[at + 6 + i] = velocity * way, acceleration * way
            rise = swing[CLEARANCE]
            out[at + 2] += 64.0 * w**3 * rise
            out[at + 5] += 192.0 * w * w * (1.0 - 2.0 * u) / period * rise
            out[at + 8] += 384.0 * w * (1.0 - 5.0 * w) / period**2 * rise
            at = int(swing[ROTATION_ENTRY])
            if at >= 0:
                yaw = swing[FIRST_YAW] + position * swing[YAW_CHANGE]
                a = swing[FIRST_TILT] + position * swing[TILT_CHANGE]
                b = swing[FIRST_TILT + 1] + position * swing[TILT_CHANGE + 1]
                # exp((a, b, 0)) = 1 + k1 W + k2 W², with sin and cos of the tilt
                tilt = np.sqrt(a * a + b * b)
                k1 = np.sin(tilt) / tilt if tilt > 1e-8 else 1.0
                k2 = 2.0 * (np.sin(tilt / 2.0) / tilt) ** 2 if tilt > 1e-8 else 0.5
                yaw_c, yaw_s = np.cos(yaw), np.sin(yaw)
                for j in range(3):
                    f0, f1 = swing[FOOT_ROTATION + j], swing[FOOT_ROTATION + 3 + j]
                    r0, r1 = yaw_c * f0 - yaw_s * f1, yaw_s * f0 + yaw_c * f1
                    r2 = swing[FOOT_ROTATION + 6 + j]
                    out[at + j] = r0 + k1 * b * r2 + k2 * b * (a * r1 - b * r0)
                    out[at + 3 + j] = r1 - k1 * a * r2 - k2 * a * (a * r1 - b * r0)
                    out[at + 6 + j] = r2 + k1 * (a * r1 - b * r0) - k2 * tilt * tilt * r2
                up = k1 * b, -k1 * a, 1.0 - k2 * tilt * tilt
                for i in range(3):
                    axis = swing[YAW_CHANGE] * up[i]
                    if i < 2:
                        axis += swing[TILT_CHANGE + i]
                    out[at + 9 + i], out[at + 12 + i] = velocity * axis, acceleration * axis

    return write_targets


write_targets = jit_cached(make_write_targets)
