// Converts between bytes and typed messages of subprotocol "catgs.v1" (../../../proto/README.md).
import { create, fromBinary, toBinary, type MessageInitShape } from '@bufbuild/protobuf';
import { BinaryReader } from '@bufbuild/protobuf/wire';
import {
  ClientMessageSchema,
  FrameHeaderSchema,
  ServerMessageSchema,
  type AckSchema,
  type ClipSchema,
  type FrameHeader,
  type HelloSchema,
  type PoseSampleSchema,
  type ServerMessage,
  type SettingsSchema,
} from './generated/catgs_pb';

export * from './generated/catgs_pb';
export * from './generated/types_pb';

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
export type ClipInit = MessageInitShape<typeof ClipSchema>;
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
      const frame = bytes.subarray(1);
      const reader = new BinaryReader(frame);
      const header = parse(() => fromBinary(FrameHeaderSchema, reader.bytes())); // behind its length
      return { kind: 'frame', header, payload: frame.subarray(reader.pos) };
    }
    default:
      return { kind: 'unknown' };
  }
}

/** Encodes one binary WebSocket message to the server. */
export function encode_client_message(body: ClientBody): Uint8Array {
  return toBinary(ClientMessageSchema, create(ClientMessageSchema, { body }));
}

function parse<T>(from_binary: () => T): T {
  try {
    return from_binary();
  } catch (cause) {
    throw new WireError(`malformed message: ${String(cause)}`, { cause });
  }
}
