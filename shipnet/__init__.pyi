from . import asi as asi
from . import ballast as ballast
from . import can as can
from . import crc as crc
from . import datasets as datasets
from . import design as design
from . import engine as engine
from . import errors as errors
from . import exercises as exercises
from . import fuzzy as fuzzy
from . import line as line
from . import modbus as modbus
from . import papers as papers
from . import remote_control as remote_control
from . import style as style
from . import tools as tools
from .compiled import Code as Code

__version__: str
