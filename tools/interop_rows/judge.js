// Asks npm's `canopen` what it reads in our EDS files, and lets it be our drive's master over a bridge on stdin and stdout.
//
// Rule of this file: it says what the package says, as JSON; `javascript.py` knows what is right.
'use strict';

const readline = require('readline');
const { DataType, Device, Eds } = require('canopen');

const [, , question, ...rest] = process.argv;
const DRIVE = 2;
const TIMEOUT = 5000; // milliseconds; its own default of 30 is too short for a busy machine
const say = (thing) => process.stdout.write(JSON.stringify(thing) + '\n');

function pdos(list) {
    return list.map((pdo) => [pdo.cobId, pdo.dataObjects.map((each) => each.parameterName), pdo.dataSize * 8]);
}

function load(file) {
    const eds = Eds.fromFile(file);
    return { objects: [...eds.keys()].length, receive: pdos(eds.getReceivePdos()), transmit: pdos(eds.getTransmitPdos()) };
}

// The values that it takes from a PDO's bytes.
function unpack(file, cobId, hex) {
    const device = new Device({ id: 1, eds: Eds.fromFile(file) });
    device.pdo.start();
    device.receive({ id: Number(cobId), data: Buffer.from(hex, 'hex') });
    const pdo = device.eds.getReceivePdos().find((each) => each.cobId === Number(cobId));
    return pdo.dataObjects.map((each) => each.value);
}

function master() {
    const eds = new Eds();
    eds.addSdoClientParameter(DRIVE, 0x600 + DRIVE, 0x580 + DRIVE);
    eds.addHeartbeatConsumer(DRIVE, TIMEOUT);
    eds.addEmcyConsumer(0x80 + DRIVE);
    const device = new Device({ id: 10, eds });
    device.addListener('message', ({ id, data }) => say({ id, data: Buffer.from(data).toString('hex') }));
    readline.createInterface({ input: process.stdin }).on('line', (line) => {
        const { id, data } = JSON.parse(line);
        device.receive({ id, data: Buffer.from(data, 'hex'), len: data.length / 2 });
    });
    device.start();
    return device;
}

const next = (emitter, event, wanted) => new Promise((resolve) => {
    const listener = (thing) => {
        if (wanted(thing)) {
            emitter.removeListener(event, listener);
            resolve(thing);
        }
    };
    emitter.on(event, listener);
});

async function talk() {
    const device = master();
    const at = (index, more) => ({ deviceId: DRIVE, index, subIndex: 0, timeout: TIMEOUT, ...more });
    const upload = (index, more) => device.sdo.upload(at(index, more));
    const said = { states: [] };
    said.period = await upload(0x1017, { dataType: DataType.UNSIGNED16 });
    said.name = await upload(0x1008, { dataType: DataType.VISIBLE_STRING });
    said.segments = (await upload(0x1021)).toString();
    said.blocks = (await upload(0x1021, { blockTransfer: true })).toString();
    said.abort = await upload(0x5000).catch((error) => error.code);
    await device.sdo.download(at(0x1017, { data: 20, dataType: DataType.UNSIGNED16 }));
    said.changed = await upload(0x1017, { dataType: DataType.UNSIGNED16 });
    for (const [command, state] of [['stopNode', 4], ['enterPreOperational', 127], ['startNode', 5], ['resetNode', 0]]) {
        const reached = next(device.nmt, 'heartbeat', (heard) => heard.state === state);
        device.nmt[command](DRIVE);
        said.states.push((await reached).state);
        if (state === 5) {
            const emergency = next(device.emcy, 'emergency', () => true);
            say({ id: 0x008, data: '000000' });
            const { em } = await emergency;
            said.emergency = [em.code, em.register, em.toString()];
        }
    }
    say({ said }); // and it goes on taking frames until it is ended
}

const QUESTIONS = { load: (...files) => say({ said: files.map(load) }), unpack: (...given) => say({ said: unpack(...given) }), talk };
QUESTIONS[question](...rest);
