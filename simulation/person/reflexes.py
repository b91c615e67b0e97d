"""Gains of the person's nervous system, one set for every size: torques scale with strength."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True, slots=True)
class Reflexes:
    """How stiffly and how far ahead the body acts; found by search and trial over many sizes, for 70 kg and 1.70 m."""

    dcm_gain_1_s: float = 2.22  # how fast errors of the divergent component die out under a standing foot
    pressure_carried: float = 0.261  # share of the present centre of pressure's offset expected until touchdown
    transfer: float = 0.262  # when the load changes feet, in shares of the shortest double support
    step_width: float = 0.115  # of the feet's middles [body heights]
    swing_hip_nm_rad: float = 635.0
    swing_hip_nms_rad: float = 66.4
    swing_knee_nm_rad: float = 546.0
    swing_knee_nms_rad: float = 30.3
    swing_yaw_nm_rad: float = 148.0
    swing_yaw_nms_rad: float = 9.15
    swing_early: float = 1.08  # the foot is above its place at 1 / this of the swing
    swing_lift_m: float = 0.034
    swing_down: float = 0.05  # how firmly the foot is put down [m per swing]
    reaction_pitch: float = 1.13  # share of the swinging leg's torque that the standing one takes up
    reaction_roll: float = 1.62
    reaction_yaw: float = 1.09
    turn_moment_nm: float = 16.6  # about the vertical, that a foot brings to the floor
    trunk_nm_rad: float = 618.0
    trunk_nms_rad: float = 59.7
    turn_nm_rad: float = 121.0
    turn_nms_rad: float = 12.5
    lift_1_s2: float = 60.0  # height of the centre of mass: stiffness over mass
    lift_1_s: float = 15.0
    arm_swing_rad: float = 0.484
    arm_nm_rad: float = 49.6
    arm_nms_rad: float = 9.38
    back_yaw_nm_rad: float = 185.0
    knees_bent: float = 0.985  # length of the standing leg, of the stretched one
    landing_leg: float = 0.985  # its length at touchdown
    alarm: float = 0.045  # the DCM that far beside where it should be hurries the step [body heights]
    alarm_swap: float = 0.02  # the DCM that far outside the leading foot makes that foot step [body heights]
    hurry: float = 0.8  # duration of a hurried swing, of the shortest step
