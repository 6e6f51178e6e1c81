"""Ballast valves with electro-hydraulic actuators: the plant, its faults, its diagnosis."""

from shipnet.ballast.actuator import Actuator, operating_point
from shipnet.ballast.diagnosis import READINGS, Diagnosis, diagnose_run
from shipnet.ballast.fleet import random_commands, random_faults, watch
from shipnet.ballast.live import TestBed, acceptance
from shipnet.ballast.master import Station, operate
from shipnet.ballast.plant import Command, Plant
from shipnet.ballast.registers import Code, RegisterMap, scale_table
from shipnet.ballast.rule_table import rule_base, rule_vectors
from shipnet.ballast.scan import assignment, scan_table, status_poll, worst_age
from shipnet.ballast.sensors import Sensors
from shipnet.ballast.simulation import Run, blocks, command_features, simulate
from shipnet.ballast.slave import ValveDevice, valve_slaves
from shipnet.ballast.trials import BASIS, confusion, false_alarms, fault_trials, rates
from shipnet.ballast.valve_faults import FAULTS, Fault, fault_table
from shipnet.ballast.wear import alarm_strokes, life_comparison, predict_life, synthetic_wear

__all__ = [
    "BASIS",
    "FAULTS",
    "READINGS",
    "Actuator",
    "Code",
    "Command",
    "Diagnosis",
    "Fault",
    "Plant",
    "RegisterMap",
    "Run",
    "Sensors",
    "Station",
    "TestBed",
    "ValveDevice",
    "acceptance",
    "alarm_strokes",
    "assignment",
    "blocks",
    "command_features",
    "confusion",
    "diagnose_run",
    "false_alarms",
    "fault_table",
    "fault_trials",
    "life_comparison",
    "operate",
    "operating_point",
    "predict_life",
    "random_commands",
    "random_faults",
    "rates",
    "rule_base",
    "rule_vectors",
    "scale_table",
    "scan_table",
    "simulate",
    "status_poll",
    "synthetic_wear",
    "valve_slaves",
    "watch",
    "worst_age",
]
