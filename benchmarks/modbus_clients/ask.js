// Poll a server with modbus-serial or jsmodbus; see ask.py.
const [library, kind, place, polls, timeout] = process.argv.slice(2);
const wait = 1000 * Number(timeout);

async function modbusSerial() {
  const ModbusRTU = require("modbus-serial");
  const client = new ModbusRTU();
  if (kind === "tcp") await client.connectTCP("127.0.0.1", { port: Number(place) });
  else await client.connectRTUBuffered(place, { baudRate: 19200 });
  client.setID(1);
  client.setTimeout(wait);
  return async (address) => (await client.readHoldingRegisters(address, 2)).data;
}

async function jsmodbus() {
  const modbus = require("jsmodbus");
  let port, client;
  if (kind === "tcp") {
    port = new (require("net").Socket)();
    client = new modbus.client.TCP(port, 1, wait);
    port.connect(Number(place), "127.0.0.1");
  } else {
    port = new (require("serialport").SerialPort)({ path: place, baudRate: 19200 });
    client = new modbus.client.RTU(port, 1, wait);
  }
  await new Promise((done) => port.on(kind === "tcp" ? "connect" : "open", done));
  return async (address) => {
    const found = (await client.readHoldingRegisters(address, 2)).response.body.valuesAsArray;
    return [...found];
  };
}

async function main() {
  const ask = await (library === "jsmodbus" ? jsmodbus() : modbusSerial());
  for (let k = 0; k < Number(polls); k++) {
    try {
      console.log("ok " + (await ask(2 * k)).join(" "));
    } catch (problem) {
      const said = problem.message || problem.err || String(problem);
      console.log("error " + String(said).replace(/\s+/g, " "));
    }
  }
  process.exit(0);
}

main();
