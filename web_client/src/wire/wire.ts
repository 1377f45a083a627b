// Converts between bytes and typed messages of subprotocol "catgs.v1" (../../../proto/README.md).
import { create, fromBinary, toBinary, type MessageInitShape } from '@bufbuild/protobuf';
import {
  ClientMessageSchema,
  FrameHeaderSchema,
  ServerMessageSchema,
  type AckSchema,
  type FrameHeader,
  type HelloSchema,
  type PoseSampleSchema,
  type ServerMessage,
  type SettingsSchema,
} from './generated/catgs_pb';

export * from './generated/catgs_pb';

export const subprotocol = 'catgs.v1';
export const wire_version = 1;

const kind_message = 1;
const kind_frame = 2;

/** The server sent a message that breaks the contract. The connection is of no further use. */
export class WireError extends Error {
  override name = 'WireError';
}

export type ServerBody = Exclude<ServerMessage['body'], { case: undefined }>;
export type ClientBody = NonNullable<MessageInitShape<typeof ClientMessageSchema>['body']>;

// Messages before encoding. Fields that are left out become zeros.
export type HelloInit = MessageInitShape<typeof HelloSchema>;
export type PoseInit = MessageInitShape<typeof PoseSampleSchema>;
export type AckInit = MessageInitShape<typeof AckSchema>;
export type SettingsInit = MessageInitShape<typeof SettingsSchema>;

export type Incoming =
  | { kind: 'message'; body: ServerBody }
  /** `payload` is a view into the received buffer, not a copy. */
  | { kind: 'frame'; header: FrameHeader; payload: Uint8Array }
  /** A newer server sent it; it is ignored. */
  | { kind: 'unknown' };

/** Parses one binary WebSocket message of the server. Throws WireError. */
export function decode_server_message(data: ArrayBuffer): Incoming {
  const bytes = new Uint8Array(data);
  switch (bytes[0]) {
    case undefined:
      throw new WireError('empty message');
    case kind_message: {
      const { body } = parse(() => fromBinary(ServerMessageSchema, bytes.subarray(1)));
      return body.case === undefined ? { kind: 'unknown' } : { kind: 'message', body };
    }
    case kind_frame: {
      const [header_length, header_begin] = read_varint(bytes, 1);
      const header_end = header_begin + header_length;
      if (header_end > bytes.length) {
        throw new WireError(
          `frame header of ${header_length} bytes in a message of ${bytes.length} bytes`,
        );
      }
      const header = parse(() =>
        fromBinary(FrameHeaderSchema, bytes.subarray(header_begin, header_end)),
      );
      return { kind: 'frame', header, payload: bytes.subarray(header_end) };
    }
    default:
      return { kind: 'unknown' };
  }
}

/** Encodes one binary WebSocket message to the server. */
export function encode_client_message(body: ClientBody): Uint8Array {
  return toBinary(ClientMessageSchema, create(ClientMessageSchema, { body }));
}

/** Reads a base-128 varint of Protobuf, at most 32 bits. Returns its value and the offset behind it. */
function read_varint(bytes: Uint8Array, offset: number): [value: number, end: number] {
  let value = 0;
  for (let shift = 0; shift < 35; shift += 7) {
    const byte = bytes[offset++];
    if (byte === undefined) throw new WireError('frame header length is cut off');
    value += (byte & 0x7f) * 2 ** shift;
    if (byte < 0x80) return [value, offset];
  }
  throw new WireError('frame header length is longer than 5 bytes');
}

function parse<T>(from_binary: () => T): T {
  try {
    return from_binary();
  } catch (cause) {
    throw new WireError(`malformed message: ${String(cause)}`, { cause });
  }
}
