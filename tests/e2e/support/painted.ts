// Pictures for a server that follows a script.
import { Codec } from '#client/wire/wire';
import { in_page } from './browser';
import { welcome, type Script } from './fake_server';

/** A JPEG file with some blobs, so that a screenshot shows whether it is the right way up. */
export async function painted_jpeg(): Promise<Uint8Array> {
  const url = await in_page((page) =>
    page.evaluate(() => {
      const canvas = document.createElement('canvas');
      canvas.width = 640;
      canvas.height = 360;
      const context = canvas.getContext('2d')!;
      const sky = context.createLinearGradient(0, 0, 0, 360);
      sky.addColorStop(0, '#7fb2e5');
      sky.addColorStop(1, '#e8d9c0');
      context.fillStyle = sky;
      context.fillRect(0, 0, 640, 360);
      for (let i = 0; i < 40; ++i) {
        context.fillStyle = `hsl(${(i * 47) % 360} 45% 45%)`;
        context.fillRect(i * 16, 200 - ((i * 37) % 90), 15, 160);
      }
      return canvas.toDataURL('image/jpeg', 0.9);
    }),
  );
  return Buffer.from(url.split(',')[1]!, 'base64');
}

/** Sends a welcome, and answers every pose with the picture. */
export const stream_of =
  (jpeg: Uint8Array, scene: Parameters<typeof welcome>[0] = {}): Script =>
  (peer, body) => {
    if (body.case === 'hello') peer.say(welcome(scene));
    if (body.case !== 'pose') return;
    peer.frame(
      {
        frameId: BigInt(peer.heard.length),
        poseId: body.value.poseId,
        poseClientTimeUs: body.value.clientTimeUs,
        ...(body.value.worldFromCamera && { renderPose: body.value.worldFromCamera }),
        fovYRad: body.value.fovYRad,
        codec: Codec.MJPEG,
        idr: true,
        widthPx: 640,
        heightPx: 360,
        renderUs: 20_000,
        encodeUs: 2000,
      },
      jpeg,
    );
  };
