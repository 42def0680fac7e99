/** The video packet, as `ik_proto.stereo_packet` writes it: a JPEG for each eye. */

const HEAD = 24;
const MAGIC = 0x56;
const VERSION = 1;

/**
 * Read a packet.
 * @param {ArrayBuffer} data One message.
 * @returns {{seq: number, takenMs: number, fovDeg: number, left: Uint8Array, right: Uint8Array}|null} Number, time by
 *   the server's clock [ms], vertical field of view [degrees] (0: not known), and the JPEGs, which share the message's
 *   memory; null where it is no such packet.
 */
export function readVideoPacket(data) {
  const view = new DataView(data);
  if (data.byteLength < HEAD || view.getUint8(0) !== MAGIC || view.getUint8(1) !== VERSION) {
    return null;
  }
  const left = view.getUint32(16, true);
  const right = view.getUint32(20, true);
  if (data.byteLength !== HEAD + left + right) {
    return null;
  }
  return {
    seq: view.getUint32(4, true),
    takenMs: view.getFloat64(8, true),
    fovDeg: view.getUint16(2, true) / 100,
    left: new Uint8Array(data, HEAD, left),
    right: new Uint8Array(data, HEAD + left, right),
  };
}
