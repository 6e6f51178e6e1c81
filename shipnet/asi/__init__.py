"""AS-Interface: telegrams, their timing, captures of a line, and a line simulated."""

from shipnet.asi.batch import (
    Requests,
    encode_requests,
    encode_responses,
    parse_requests,
    parse_responses,
)
from shipnet.asi.calls import Call
from shipnet.asi.capture import Capture, decode
from shipnet.asi.frame import REQUEST_BITS, RESPONSE_BITS
from shipnet.asi.profile import IO_CONFIGURATIONS, Profile
from shipnet.asi.response import Response
from shipnet.asi.simulation import Master, Slave, simulate
from shipnet.asi.telegram import Request
from shipnet.asi.timing import BIT_TIME, Timing, Transaction
from shipnet.line.scope_file import read_waveform
from shipnet.line.waveform import Waveform

__all__ = [
    "BIT_TIME",
    "IO_CONFIGURATIONS",
    "REQUEST_BITS",
    "RESPONSE_BITS",
    "Call",
    "Capture",
    "Master",
    "Profile",
    "Request",
    "Requests",
    "Response",
    "Slave",
    "Timing",
    "Transaction",
    "Waveform",
    "decode",
    "encode_requests",
    "encode_responses",
    "parse_requests",
    "parse_responses",
    "read_waveform",
    "simulate",
]
