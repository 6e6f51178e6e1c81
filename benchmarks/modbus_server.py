"""How long a client of our server or of pymodbus's waits while others pipeline requests.

Each server runs in its own process, as does each other client, which sends as fast as it can, reads
its responses or ignores them, and reconnects when disconnected. pymodbus responds to none of their
requests, because it drops data that arrive in portions longer than a frame.
"""

import asyncio
import multiprocessing as mp
import select
import socket
from time import perf_counter, sleep

import numpy as np
from pymodbus.server import ModbusTcpServer
from pymodbus.simulator import DataType, SimData, SimDevice

from shipnet.modbus import Request, Slave, serve

POLLS, LIMIT = 500, 5.0  # requests of the polling client, and its time-out [s]
REGISTERS = 38  # all points of the largest junction box of lee2012
ASK = Request.read_holding_registers(0, REGISTERS).tcp(1, 1)
ANSWER = 9 + 2 * REGISTERS


def hold(kind, pipe):
    """Start a server and send its port through the pipe."""
    if kind == "ours":
        with serve({1: Slave(holding_registers=[7] * REGISTERS)}) as server:
            pipe.send(server.port)
            pipe.recv()

    async def theirs():
        memory = SimData(0, count=REGISTERS, values=7, datatype=DataType.REGISTERS)
        server = ModbusTcpServer(SimDevice(1, memory), address=("127.0.0.1", 0))
        await server.serve_forever(background=True)
        pipe.send(server.transport.sockets[0].getsockname()[1])
        await asyncio.sleep(3600)

    asyncio.run(theirs())


def press(port, reads, answered):
    """Send requests as fast as the server accepts them; count the responses that are read."""
    many = ASK * 1000
    while True:
        with socket.create_connection(("127.0.0.1", port)) as client:
            client.setblocking(False)
            rest = many
            try:
                while True:
                    here, there, _ = select.select([client] * reads, [client], [])
                    if here:
                        data = client.recv(1 << 18)
                        if not data:
                            break
                        answered.value += len(data) // ANSWER
                    if there:
                        rest = rest[client.send(rest) :] or many
            except OSError:
                pass


def polls(port):
    """Return how long each response took [s], or `LIMIT` if it did not arrive."""
    times = []
    for _ in range(POLLS):
        begin = perf_counter()
        try:
            with socket.create_connection(("127.0.0.1", port), LIMIT) as client:
                begin = perf_counter()
                client.sendall(ASK)
                left = ANSWER
                while left and (data := client.recv(left)):
                    left -= len(data)
                times.append(LIMIT if left else perf_counter() - begin)
        except TimeoutError:
            times.append(LIMIT)
        if sum(times) > 6 * LIMIT:
            break
        sleep(0.002)
    return np.array(times)


def main():
    title = f"{'beside':<24}{'server':<10}{'median ms':>10}{'99 % ms':>10}{'worst ms':>10}"
    print(title + f"{'other responses/s':>24}")
    for beside in ("nobody", "one that reads", "one that does not read", "four that read"):
        for kind in ("ours", "pymodbus"):
            pipe, far = mp.Pipe()
            processes = [mp.Process(target=hold, args=(kind, far), daemon=True)]
            processes[0].start()
            port, answered = pipe.recv(), mp.Value("q", 0, lock=False)
            if beside != "nobody":
                args = (port, beside != "one that does not read", answered)
                for _ in range(4 if beside.startswith("four") else 1):
                    processes.append(mp.Process(target=press, args=args, daemon=True))
                    processes[-1].start()
                sleep(0.3)
            before, begin = answered.value, perf_counter()
            times = 1e3 * polls(port)
            rate = (answered.value - before) / (perf_counter() - begin)
            for process in reversed(processes):
                process.terminate()
                process.join()
            shown = (np.median(times), np.quantile(times, 0.99), times.max())
            print(f"{beside:<24}{kind:<10}{''.join(f'{t:>10.2f}' for t in shown)}{rate:>24.0f}")


if __name__ == "__main__":
    main()
