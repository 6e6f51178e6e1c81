from .cable import CABLES as CABLES
from .cable import Cable as Cable
from .network import CableRun as CableRun
from .network import Load as Load
from .network import Network as Network
from .waveform import Waveform as Waveform
