#include "server/commands.h"

#include <chrono>
#include <iostream>
#include <memory>
#include <string>

#include "server/access.h"
#include "server/encode/selftest.h"

namespace catgs {
namespace {

struct TokenOptions {
  LinkGrant grant;
  std::string expires = "7d";
  std::string key_file;
};

}  // namespace

void add_selftest_command(CLI::App& app, int& exit_code) {
  CLI::App* command = app.add_subcommand(
      "selftest", "Encode, decode, compare and time every encoder; say why one is unusable");
  command->callback([&exit_code] { exit_code = run_selftest(std::cout); });
}

void add_token_command(CLI::App& app, int& exit_code) {
  CLI::App* command = app.add_subcommand("token", "Make an access token for an expiring link");
  auto options = std::make_shared<TokenOptions>();
  command->add_option("--scene", options->grant.scene_id, "Scene id; without it every scene");
  command
      ->add_option(
          "--role", options->grant.role,
          "viewer; author: may also save tours; spectator: only watches others; solo: neither "
          "watches nor is watched")
      ->capture_default_str();
  command->add_option("--expires", options->expires, "Life of the link: 90s, 30m, 12h, 7d")
      ->capture_default_str();
  command->add_option("--token-key-file", options->key_file, "The key file of the server")
      ->required();
  command->callback([options, &exit_code] {
    const auto now = std::chrono::system_clock::now() + parse_duration(options->expires);
    options->grant.expires_unix_s =
        std::chrono::duration_cast<std::chrono::seconds>(now.time_since_epoch()).count();
    std::cout << make_link_token(options->grant,
                                 read_key_file("--token-key-file", options->key_file))
              << '\n';
    std::cerr << "append it to the page's address: https://HOST/#token=TOKEN\n";
    exit_code = 0;
  });
}

}  // namespace catgs
