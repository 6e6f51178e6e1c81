from .can_load import CanLoad as CanLoad
from .engine_faults import EngineFaults as EngineFaults
from .modbus_scan import ModbusScan as ModbusScan
from .ring_buffer import ReceiveRing as ReceiveRing
from .step import draw_steps as draw_steps
from .step import stepper as stepper
