"""Kim and Ko, 2001 (docs/evidence/paper001.md): its page against brute force and reference values."""

import math
from typing import Any

import numpy as np
import pytest
from page_code import run_page
from scipy.optimize import brentq

from milling_brute_force import Cutter, turn
from shapegcode.io.units import FloatArray


def corners() -> dict[int, Any]:
    found: dict[int, Any] = run_page("evidence/paper001.md")["corners"]
    return found


TOOL = Cutter(8.0, 6, math.radians(50.0), 22.57 * 9.80665, -0.153, 0.41, -0.0775, local=False)


def resultant_n(radial_depth_mm: float, feed_mm_per_min: float, rev_per_min: float) -> FloatArray:
    """Resultant over a revolution: eq. 1 to 5, 8 and 9, k1 and k2 at the mean chip."""
    arc = np.array([[-0.5 * math.pi, math.asin(radial_depth_mm / 4.0 - 1.0), 0.0, 15.0]])
    return np.hypot(*turn(TOOL, arc, feed_mm_per_min / (6 * rev_per_min)).force.T)


def test_case_1_geometry() -> None:
    deepest = corners()[1].deepest
    assert deepest.radial_depth_mm == pytest.approx(2.103, abs=5e-4)
    assert math.degrees(deepest.turned_rad) == pytest.approx(14.2, abs=0.05)
    # distance of the tool's circle and the rough arc, both of radius 4 + 4 and 8 about their centres, by search
    angles = np.radians(np.linspace(0.0, 30.0, 301))
    depths = [_depth_on_arc(angle) for angle in angles]
    assert max(depths) == pytest.approx(deepest.radial_depth_mm, abs=1e-4)
    assert angles[int(np.argmax(depths))] == pytest.approx(deepest.turned_rad, abs=math.radians(0.2))


def _depth_on_arc(turned: float) -> float:
    """Radial depth on the arc of case 1: finished corner about (-8, 8), rough one about (-8.8, 8.8), both of 8 mm."""
    centre = np.array([-8.0 + 4.0 * math.sin(turned), 8.0 - 4.0 * math.cos(turned)])
    outward = np.array([math.sin(turned), -math.cos(turned)])
    forward = np.array([math.cos(turned), math.sin(turned)])

    def beyond(azimuth: float) -> float:
        rim = centre + 4.0 * (math.cos(azimuth) * forward - math.sin(azimuth) * outward)
        return float(np.hypot(*(rim - np.array([-8.8, 8.8])))) - 8.0

    meets = brentq(beyond, -0.5 * math.pi + 1e-9, 0.5 * math.pi)
    return 4.0 * (1.0 + math.sin(meets))


def test_case_1_feeds_and_forces() -> None:
    first = corners()[1]
    depth = first.deepest.radial_depth_mm
    feeds = first.seventh.feed
    assert feeds.min() == pytest.approx(90.8, abs=0.1)
    assert feeds.min() == pytest.approx(91.0, abs=0.5)  # what the paper prints
    assert feeds.max() == 216.0
    straight, worst = resultant_n(0.8, 216.0, 1800.0), resultant_n(depth, 216.0, 1800.0)
    assert feeds.min() == pytest.approx(216.0 * straight.mean() / worst.mean(), rel=2e-3)
    assert first.programmed.peak.max() == pytest.approx(worst.max(), rel=5e-3)
    assert first.scheduled.target_n == pytest.approx(straight.max(), rel=5e-3)
    assert (first.above_mean_percent, first.above_peak_percent) == pytest.approx((16.0, 10.0), abs=0.5)
    assert first.drop_percent == pytest.approx(50.0, abs=2.0)
    assert 0.5 <= first.blocks_mm.min() <= first.blocks_mm.max() <= 0.6
    for found, of in ((first.constant_mean, np.mean), (first.constant_peak, np.max)):
        feed = brentq(lambda feed, of=of: of(resultant_n(depth, feed, 1800.0)) - of(straight), 50.0, 216.0)
        assert found == pytest.approx(feed, rel=1e-2)


def test_the_radial_depth_jumps_less_than_the_paper_says() -> None:
    second, third = corners()[2], corners()[3]
    # At the vertex the tool of case 2 meets the straight rough wall x = -0.8: its centre is at (-4, 4).
    assert second.deepest.radial_depth_mm == pytest.approx(4.0 + math.sqrt(4.0**2 - 3.2**2), rel=1e-9)
    assert second.depth_mm[second.worst + 1] == pytest.approx(0.8)
    # Its circle and the whole circle of the rough corner meet at the paper's 0.9 D; in case 3 where the tool is.
    assert _where_circles_meet(4.0) == pytest.approx(7.2, rel=1e-12)
    assert third.deepest.radial_depth_mm == pytest.approx(_where_circles_meet(8.0), rel=1e-6)
    assert third.deepest.radial_depth_mm / 8.0 == pytest.approx(0.84, abs=0.005)


def _where_circles_meet(rough_mm: float) -> float:
    """Depth at the vertex if the rough corner were a whole circle about (-rough - 0.8, rough + 0.8)."""
    apart = math.sqrt(2.0) * (rough_mm + 0.8 - 4.0)
    along = (apart**2 + 4.0**2 - rough_mm**2) / (2.0 * apart)
    return 4.0 + (along + math.sqrt(4.0**2 - along**2)) / math.sqrt(2.0)


@pytest.mark.parametrize("number", [1, 2, 3])
def test_the_scheduler_keeps_the_limit_and_gains(number: int) -> None:
    corner = corners()[number]
    scheduled, depth = corner.scheduled, corner.deepest.radial_depth_mm
    assert scheduled.along.peak.max() <= scheduled.target_n
    assert scheduled.share_near > 0.8
    assert scheduled.gain_percent >= 15.0
    assert scheduled.schedule.warnings == ()
    # The constant feed that it is compared with is the highest: a tenth more is too much.
    constant = scheduled.constant_mm_per_min
    assert resultant_n(depth, 0.99 * constant, corner.rev_per_min).max() < scheduled.target_n
    assert resultant_n(depth, 1.01 * constant + 0.1, corner.rev_per_min).max() > scheduled.target_n


def test_the_wall_is_better() -> None:
    wall = run_page("evidence/paper001.md")["largest_um"]
    assert wall["scheduled"] < wall["equation 7"] < 0.6 * wall["programmed"]
