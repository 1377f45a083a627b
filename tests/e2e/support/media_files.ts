// Small pictures, films and sounds, made here so that no test needs a file or a program for them.
import { in_page } from './browser';

/** A quiet tone as a WAV file: mono, 8 kHz, 8 bits. */
export function tone(seconds: number): Buffer {
  const samples = Math.round(8000 * seconds);
  const file = Buffer.alloc(44 + samples);
  file.write('RIFF', 0);
  file.writeUInt32LE(36 + samples, 4);
  file.write('WAVEfmt ', 8);
  file.writeUInt32LE(16, 16);
  file.writeUInt16LE(1, 20); // PCM
  file.writeUInt16LE(1, 22); // one channel
  file.writeUInt32LE(8000, 24);
  file.writeUInt32LE(8000, 28);
  file.writeUInt16LE(1, 32);
  file.writeUInt16LE(8, 34);
  file.write('data', 36);
  file.writeUInt32LE(samples, 40);
  for (let i = 0; i < samples; ++i) file[44 + i] = 128 + Math.round(20 * Math.sin(i / 3));
  return file;
}

/** A film of a second, as the browser records a canvas. */
export async function painted_film(): Promise<Buffer> {
  const url = await in_page((page) =>
    page.evaluate(async () => {
      const canvas = document.createElement('canvas');
      canvas.width = 320;
      canvas.height = 180;
      const context = canvas.getContext('2d')!;
      const recorder = new MediaRecorder(canvas.captureStream(10), {
        mimeType: 'video/webm;codecs=vp8',
      });
      const pieces: Blob[] = [];
      recorder.ondataavailable = ({ data }) => pieces.push(data);
      recorder.start();
      for (let i = 0; i < 10; ++i) {
        context.fillStyle = `hsl(${i * 36} 60% 50%)`;
        context.fillRect(0, 0, 320, 180);
        await new Promise((resolve) => setTimeout(resolve, 100));
      }
      const stopped = new Promise((resolve) => recorder.addEventListener('stop', resolve));
      recorder.stop();
      await stopped;
      return new Promise<string>((resolve) => {
        const reader = new FileReader();
        reader.onload = () => resolve(reader.result as string);
        reader.readAsDataURL(new Blob(pieces));
      });
    }),
  );
  return Buffer.from(url.split(',')[1]!, 'base64');
}

export const captions = 'WEBVTT\n\n00:00.000 --> 00:20.000\nThis <i>hall</i> was built in 1904.\n';
