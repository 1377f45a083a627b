// Gives the browser tests of a run a folder for temporary files, which goes with them.
import { mkdtempSync, rmSync } from 'node:fs';
import { tmpdir } from 'node:os';
import path from 'node:path';
import type { TestProject } from 'vitest/node';

declare module 'vitest' {
  interface ProvidedContext {
    readonly scratch: string;
  }
}

export default function (project: TestProject): () => void {
  const scratch = mkdtempSync(path.join(tmpdir(), 'catgs-browser-tests-'));
  project.provide('scratch', scratch);
  // Chromium may still be writing.
  return () => rmSync(scratch, { recursive: true, force: true, maxRetries: 20, retryDelay: 100 });
}
