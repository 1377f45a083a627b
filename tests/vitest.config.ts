import { fileURLToPath } from 'node:url';
import { defineConfig } from 'vitest/config';

export default defineConfig({
  // A minimal system knows no name "localhost".
  server: { host: '127.0.0.1' },
  resolve: { alias: { '#client': fileURLToPath(new URL('../web_client/src', import.meta.url)) } },
  test: {
    // Files share what they import; tests share no stubs.
    isolate: false,
    unstubGlobals: true,
    restoreMocks: true,
    projects: [
      { extends: true, test: { name: 'unit', include: ['web_client/**/*.test.ts'] } },
      {
        extends: true,
        test: {
          name: 'browser',
          include: ['e2e/**/*.test.ts'],
          // One after the other in one process, which has one browser: machines may have two cores.
          poolOptions: { forks: { singleFork: true } },
          globalSetup: ['e2e/support/global_setup.ts'],
          setupFiles: ['e2e/support/setup.ts'],
          testTimeout: 120_000,
          hookTimeout: 120_000,
          expect: { poll: { timeout: 60_000, interval: 100 } },
        },
      },
    ],
  },
});
