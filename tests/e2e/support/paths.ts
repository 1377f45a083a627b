// Settings from CTest, in the environment. The defaults are for running the tests by hand.
import path from 'node:path';
import { fileURLToPath } from 'node:url';

export const source_dir = fileURLToPath(new URL('../../..', import.meta.url));

export const build_dir =
  process.env['CATGS_BUILD_DIR'] ?? path.join(source_dir, 'build', 'release');

export const chromium_path = process.env['CATGS_CHROMIUM'] ?? '/usr/bin/chromium';

export const firefox_path = process.env['CATGS_FIREFOX'] ?? '/usr/bin/firefox-esr';

export const haproxy_path = process.env['CATGS_HAPROXY'] ?? '/usr/sbin/haproxy';

/** Folder for screenshots. */
export const artefacts =
  process.env['CATGS_TEST_ARTEFACTS'] ?? path.join(build_dir, 'tests', 'browser');
