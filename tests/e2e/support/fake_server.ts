// A server that follows the script of a test. It serves the built client over HTTP with the real server's
// Content-Security-Policy, and speaks catgs.v1 on a WebSocket.
import { createServer } from 'node:http';
import { readFile } from 'node:fs/promises';
import type { AddressInfo } from 'node:net';
import path from 'node:path';
import { WebSocketServer, type WebSocket } from 'ws';
import { create, fromBinary, toBinary, type MessageInitShape } from '@bufbuild/protobuf';
import { BinaryWriter } from '@bufbuild/protobuf/wire';
import {
  ClientMessageSchema,
  Codec,
  Error_Code,
  FrameHeaderSchema,
  ServerMessageSchema,
  type ClientMessage,
} from '#client/wire/wire';
import type { SceneListing } from '#client/session/scenes';
import { clean_up } from './clean_up';
import { build_dir } from './paths';

export const web_dist = path.join(build_dir, 'web_client/dist');

const policy =
  "default-src 'none'; script-src 'self'; worker-src 'self'; connect-src 'self'; " +
  "img-src 'self' blob: data:; media-src 'self'; style-src 'self'; base-uri 'none'; form-action 'none'; frame-ancestors 'none'";

const content_types: Readonly<Record<string, string>> = {
  '.html': 'text/html; charset=utf-8',
  '.js': 'text/javascript',
  '.css': 'text/css',
  '.svg': 'image/svg+xml',
};

export type ServerBody = NonNullable<MessageInitShape<typeof ServerMessageSchema>['body']>;
type Body = ClientMessage['body'];

/** One client's connection, as the test's script sees it. */
export interface Peer {
  say(body: ServerBody): void;
  frame(header: MessageInitShape<typeof FrameHeaderSchema>, payload: Uint8Array): void;
  close(): void;
  readonly heard: Body[];
}

export interface FakeServer {
  readonly url: string;
  readonly peers: Peer[];
  close(): Promise<void>;
}

interface Offer {
  readonly scenes?: readonly Partial<SceneListing>[];
  readonly poster?: Uint8Array;
  readonly before_worker?: string; // runs before the script of the worker
  readonly tours?: readonly object[]; // of every scene, as a sidecar has them
}

/** Called for each message of each client. */
export type Script = (peer: Peer, body: Body) => void;

export const at_hello =
  (say: ServerBody): Script =>
  (peer, body) => {
    if (body.case === 'hello') peer.say(say);
  };

export const refuse = (code: Error_Code, message: string): Script =>
  at_hello({ case: 'error', value: { code, message, fatal: true } });

export async function start_fake_server(
  script: Script,
  {
    scenes = [{ id: 'city', title: 'Demo city' }],
    poster,
    tours = [],
    before_worker = '',
  }: Offer = {},
): Promise<FakeServer> {
  const http = createServer((request, response) => {
    const name = new URL(request.url ?? '/', 'http://localhost').pathname;
    if (name === '/api/scenes') {
      response.end(JSON.stringify({ scenes }));
      return;
    }
    if (poster && name.endsWith('/poster.jpg')) {
      response.writeHead(200, { 'content-type': 'image/jpeg' });
      response.end(poster);
      return;
    }
    if (name.startsWith('/api/scenes/')) {
      response.end(JSON.stringify({ document: { tours } }));
      return;
    }
    const file = path.join(web_dist, name === '/' ? 'index.html' : name);
    readFile(file).then(
      (body) => {
        response.writeHead(200, {
          'content-type': content_types[path.extname(file)] ?? 'application/octet-stream',
          'content-security-policy': policy,
        });
        if (name.includes('/worker-')) response.write(before_worker);
        response.end(body);
      },
      () => response.writeHead(404).end(),
    );
  });
  const peers: Peer[] = [];
  const sockets = new WebSocketServer({ server: http, handleProtocols: () => 'catgs.v1' });
  sockets.on('connection', (socket) => {
    const peer = make_peer(socket);
    peers.push(peer);
    socket.on('message', (data) => {
      const { body } = fromBinary(ClientMessageSchema, new Uint8Array(data as Buffer));
      peer.heard.push(body);
      script(peer, body);
    });
  });
  await new Promise<void>((resolve) => http.listen(0, '127.0.0.1', resolve));
  const close = async (): Promise<void> => {
    for (const socket of sockets.clients) socket.terminate();
    http.closeAllConnections();
    await new Promise((resolve) => http.close(resolve));
  };
  clean_up(close);
  return { url: `http://127.0.0.1:${(http.address() as AddressInfo).port}/`, peers, close };
}

function make_peer(socket: WebSocket): Peer {
  return {
    heard: [],
    say(body) {
      const bytes = toBinary(ServerMessageSchema, create(ServerMessageSchema, { body }));
      socket.send(Buffer.concat([Buffer.of(1), bytes]));
    },
    frame(header, payload) {
      const bytes = toBinary(FrameHeaderSchema, create(FrameHeaderSchema, header));
      socket.send(new BinaryWriter().raw(Uint8Array.of(2)).bytes(bytes).raw(payload).finish());
    },
    close: () => socket.close(),
  };
}

interface SceneWords {
  readonly upIsDoubtful?: boolean;
  readonly title?: string;
  readonly credits?: string;
  readonly scale?: number;
  readonly startPose?: object;
}

/** A welcome to a small scene whose pictures are JPEGs of 640x360. */
export function welcome(scene: SceneWords = {}): ServerBody {
  return {
    case: 'welcome',
    value: {
      version: 1,
      sessionId: 's1',
      resumeToken: 'resume-me',
      scene: {
        sceneId: 'city',
        title: 'Demo city',
        gaussians: 300_000n,
        up: { x: 0, y: -1, z: 0 },
        startPose: { position: { x: 0, y: 0, z: -5 }, orientation: { w: 1 } },
        focus: {},
        limitsMin: { x: -20, y: -20, z: -20 },
        limitsMax: { x: 20, y: 20, z: 20 },
        nearZ: 0.2,
        ...scene,
      },
      config: {
        codec: Codec.MJPEG,
        widthPx: 640,
        heightPx: 360,
        fps: 60,
        encoder: 'mjpeg (the client decodes nothing else)',
      },
      renderer: 'CPU, AVX2, 2 threads (no CUDA device)',
      serverVersion: '0.1.0',
      sceneIds: ['city', 'garden'],
    },
  };
}
