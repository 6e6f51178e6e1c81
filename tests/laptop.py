"""Update a tool and compile a loop: for the laptops of the test workflow, which have no pytest."""

from shipnet import can, compiled, tools

page = tools.ModbusScan().explore()
before = page._answer
page.controls["dead"].value = 3
assert page._answer.inputs != before.inputs, "the tool was not updated"
can.simulate(can.example(), 125e3, until=100.0)
assert any("fast" in vars(kernel) for kernel in compiled.KERNELS.values()), "nothing is compiled"
