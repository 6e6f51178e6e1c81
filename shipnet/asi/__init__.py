"""AS-Interface: telegrams, their timing, and captures of a line."""

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
from shipnet.asi.telegram import Request
from shipnet.asi.timing import BIT_TIME, Transaction
from shipnet.asi.waveform_file import Waveform, read_waveform

__all__ = [
    "BIT_TIME",
    "IO_CONFIGURATIONS",
    "REQUEST_BITS",
    "RESPONSE_BITS",
    "Call",
    "Capture",
    "Profile",
    "Request",
    "Requests",
    "Response",
    "Transaction",
    "Waveform",
    "decode",
    "encode_requests",
    "encode_responses",
    "parse_requests",
    "parse_responses",
    "read_waveform",
]
