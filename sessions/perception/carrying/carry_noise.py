"""How uncertain a carry is, and where the object lies at the next grasp."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np


@dataclass(frozen=True)
class LinkTimes:
    """For how long links were on the object, which feel nothing; seconds.

    Attributes:
        opened_s: while the hand opened after a carry.
        landed_s: while it came down again.
        closed_s: while it closed again.
    """

    opened_s: float = 0.0
    landed_s: float = 0.0
    closed_s: float = 0.0


UNPUSHED = LinkTimes()
"""No link was on the object."""


@dataclass(frozen=True)
class CarryNoise:
    """Standard deviations of a carry, fitted to simulated carries other than the reported ones (decisions 55, 83,
    121, 144, 153, 158, 163, 165).

    Attributes:
        least_m, least_rad: of any carry.
        spread_m, spread_rad: share of the differences between the answers of other assumptions about friction.
        turned_rad: of the square of the turn by which it slipped: contacts that slide far are not where the balance
            has them.
        missing_rad: share of the turn by which it slipped, for each fingertip of five that did not hold it.
        aside: how far from its middle the point may be about which the object turns, as a share of its half width;
            what is round turns about its middle, if more than two fingertips hold it.
        round_rad: share of the hand's turn that a round object may be off by, over the fingertips beyond two.
        roll_m: how far an object whose sides face down rolls or rocks when it is let go and grasped, over the sine.
        vertical_m_N: the same for each newton with which fingertips beside it hold it up or press it down.
        let_go_rad_N: how the opening hand turns the object, for each newton with which it still pressed.
        pushed_m_N, pushed_rad_N: for each newton by which the fingertips' net force exceeded what a table's friction
            explains: links pushed the object then, which feel nothing.
        closed_m_N, closed_rad_N: for each newton by which it exceeded that while the hand closed the next time.
        links_m, links_rad: where links pushed for a second meanwhile; grows with the power 1.25 of that time.
        landed_m_s, landed_rad_s: for each second in which links were on the object when the hand came down before.
        stood_m, stood_rad: of an object that was not carried, by touches and closings that should not move it.
        unseen: share of the hand's motion while fewer than two fingertips held the object, one was silent, or the
            object resisted.
    """

    least_m: float = 0.000075
    least_rad: float = float(np.deg2rad(0.03))
    spread_m: float = 1.05
    spread_rad: float = 0.62
    turned_rad: float = 0.40
    missing_rad: float = 0.10
    aside: float = 0.58
    round_rad: float = 0.079
    roll_m: float = 0.00285
    vertical_m_N: float = 0.0004
    let_go_rad_N: float = float(np.deg2rad(0.08))
    pushed_m_N: float = 0.001
    pushed_rad_N: float = float(np.deg2rad(0.5))
    closed_m_N: float = 0.003
    closed_rad_N: float = float(np.deg2rad(1.9))
    links_m: float = 0.0031
    links_rad: float = float(np.deg2rad(2.2))
    landed_m_s: float = 0.005
    landed_rad_s: float = float(np.deg2rad(5.0))
    stood_m: float = 0.00025
    stood_rad: float = float(np.deg2rad(0.3))
    unseen: float = 0.5

    @property
    def after_m(self) -> tuple[float, float, float]:
        """Of what happens once the hand lets go: net force, links that push, links that land."""
        return self.closed_m_N, self.links_m, self.landed_m_s

    @property
    def after_rad(self) -> tuple[float, float, float]:
        """The same of the turn."""
        return self.closed_rad_N, self.links_rad, self.landed_rad_s
