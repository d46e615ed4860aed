"""Tracker configurations for instances and objects of bird's-eye-view maps, and for people."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from tracking.association.costs import AssociationConfig
from tracking.filtering.kalman import MotionConfig
from tracking.io.mot_challenge import FORGET_S
from tracking.track_table import LifecycleConfig
from tracking.tracker import REMATCH_STAGE, TrackerConfig

# Predicted maps flicker, so low-confidence detections need two hits. Centres jump where instances merge or split: the
# noise across the heading covers turns.
MAPS = TrackerConfig(
    lifecycle=LifecycleConfig(
        confirm_log_odds=2.2,
        confirm_s=0.15,
        coast_s=0.35,
        coast_std_m=0.8,
        coast_chance=0.0,
        lost_s=2.2,
        memory_s=np.inf,
        motion=MotionConfig(
            along_accel_psd_m2ps3=2.0,
            across_accel_psd_m2ps3=0.2,
            heading_psd_rad2ps=0.0,
            along_std_m=0.3,
            across_std_m=0.3,
            stationary_psd=1.0,
        ),
    ),
    association=AssociationConfig(min_gate_m=2.5, gate_speed_mps=40.0, max_gate_m=20.0, max_size_cost=9.0),
    rematch=replace(REMATCH_STAGE, gate_speed_mps=12.0, max_gate_m=8.0),
    classes={},
)

# Scores of objects are calibrated: sure ones are reported at once, likely ones after two hits, others start no track.
OBJECTS = replace(MAPS, init_threshold=1.0, lifecycle=replace(MAPS.lifecycle, confirm_log_odds=2.0))


def _people(position_std_m: float, min_gate_m: float, coast_std_m: float) -> TrackerConfig:
    """Return the configuration for people, given the standard deviation of their positions.

    People move in any direction, regardless of heading. They stand close together, so that tracks are soon lost and
    hardly coast; box heights separate near people from far ones. A false box seldom repeats: the second one confirms.
    """
    association = AssociationConfig(
        min_gate_m=min_gate_m,
        gate_speed_mps=4.0,
        max_gate_m=2.0,
        max_heading_cost=0.0,
        size_log_std=0.2,
        max_size_cost=9.0,
        max_cost=50.0,
    )
    motion = MotionConfig(
        along_speed_std_mps=1.5,
        across_speed_std_mps=1.5,
        along_accel_psd_m2ps3=0.1,
        across_accel_psd_m2ps3=0.1,
        along_std_m=position_std_m,
        across_std_m=position_std_m,
    )
    lifecycle = LifecycleConfig(
        confirm_log_odds=2.2,
        confirm_first_log_odds=0.5,
        confirm_s=0.03,
        coast_s=0.12,
        coast_std_m=coast_std_m,
        coast_chance=0.0,
        lost_s=0.3,
        forget_s=FORGET_S,
        forget_stationary_s=FORGET_S,
        stationary_mps=0,
        motion=motion,
    )
    return TrackerConfig(
        init_threshold=0.5,
        lifecycle=lifecycle,
        association=association,
        rematch=replace(association, gate_chi2=15.0),
        classes={},
        colour_outlier_rate=1.0,
        occlusion=False,
    )


# Foot points in the image are more accurate than positions on the ground derived from them. A predicted box overlaps
# a person, who is half a metre wide, only if its position is well known.
PEOPLE_IN_IMAGE, PEOPLE_ON_GROUND = _people(0.1, 0.4, coast_std_m=0.1), _people(0.2, 0.8, coast_std_m=0.8)
