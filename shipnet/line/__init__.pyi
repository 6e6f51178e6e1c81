from .cable import CABLES as CABLES
from .cable import Cable as Cable
from .characteristics import Driver as Driver
from .characteristics import simulate as simulate
from .network import CableRun as CableRun
from .network import Load as Load
from .network import Network as Network
from .waveform import Waveform as Waveform
