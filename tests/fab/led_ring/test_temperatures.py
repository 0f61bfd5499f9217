"""Temperatures of the LED ring against a network of resistances that is solved as a matrix."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest

from cad.params import EndcapParams
from fab.led_ring.budget import CAMERA_A, temperatures_c, thermal_checks, warmest_room_c
from fab.led_ring.driver import choose_driver


def failed(checks) -> set[str]:
    return {check.name for check in checks if not check.ok}


def test_temperatures_rise_with_power_and_fall_with_size():
    driver, small, large = choose_driver(), EndcapParams(110, 7), EndcapParams(180, 10)
    assert temperatures_c(driver, small, 25)["board"] > temperatures_c(driver, large, 25)["board"]
    rise = [temperatures_c(driver, large, room)["board"] - room for room in (0, 30)]
    assert rise[0] == pytest.approx(rise[1])
    assert failed(thermal_checks(driver, large)) == set()
    assert "ring.led_junction_c" in failed(thermal_checks(replace(driver, r_set_ohm=2.0), small))


def test_temperatures_are_those_of_a_network_of_resistances():
    """Kirchhoff's law at four nodes, solved as a matrix; W, K and m."""
    driver, dome, ring = choose_driver(), 2 * math.pi * 0.065**2, math.pi * (0.0386**2 - 0.03155**2)
    board_w = driver.input_w - 0.45 * driver.led_w  # what does not leave as light
    air_w = 0.45 * driver.led_w + CAMERA_A * 5.0
    air, inner, outer, board = range(4)
    links = [(board, air, (12.0 + 0.15 / 0.012) * ring), (air, inner, 8.0 * dome), (inner, outer, 0.2 / 0.008 * dome)]
    matrix, flow = np.zeros((4, 4)), np.zeros(4)
    for one, other, w_k in links:
        matrix[one, one], matrix[other, other] = matrix[one, one] + w_k, matrix[other, other] + w_k
        matrix[one, other], matrix[other, one] = matrix[one, other] - w_k, matrix[other, one] - w_k
    matrix[outer, outer] += 8.0 * dome  # to the room at 0
    flow[board], flow[air] = board_w, air_w
    found, params = np.linalg.solve(matrix, flow), EndcapParams(130, 8)
    stated = temperatures_c(driver, params, 20.0)
    assert stated["air inside"] == pytest.approx(20 + found[air]) and stated["board"] == pytest.approx(
        20 + found[board]
    )
    assert stated["led junction"] - stated["board"] == pytest.approx(40.0 * 0.55 * driver.led_v * driver.led_a)
    assert temperatures_c(driver, params, warmest_room_c(driver, params))["board"] == pytest.approx(70.0)
