#include "server/commands.h"

#include <chrono>
#include <iostream>
#include <memory>
#include <string>

#include <CLI/CLI.hpp>

#include "render_core/base/error.h"
#include "server/access/access.h"
#include "server/base/scene_id.h"
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
  CLI::App* command =
      app.add_subcommand("selftest", "Test and time every encoder; say why one cannot be used");
  command->callback([&exit_code] { exit_code = run_selftest(std::cout); });
}

void add_token_command(CLI::App& app, int& exit_code) {
  CLI::App* command = app.add_subcommand("token", "Make an access token for an expiring link");
  command->footer("Example: catgs-server token --token-key-file KEY --scene hall-kdfmqrtv");
  auto options = std::make_shared<TokenOptions>();
  command->add_option("--scene", options->grant.scene_id,
                      "Scene id, as /api/scenes lists it; without it every scene");
  command
      ->add_option(
          "--role", options->grant.role,
          "viewer; author: may also save tours; spectator: may only watch others; solo: neither "
          "watches nor is watched")
      ->capture_default_str();
  command->add_option("--expires", options->expires, "Lifetime of the link: 90s, 30m, 12h, 7d")
      ->capture_default_str();
  command->add_option("--token-key-file", options->key_file, "Key file of the server")->required();
  command->callback([options, &exit_code] {
    const std::string& scene_id = options->grant.scene_id;
    const bool by_name = !scene_id.empty() && !belongs_to_path(scene_id);
    if (by_name && options->grant.role == "author")
      throw InputError("--scene " + scene_id, {}, "is a name, which may come to mean another file",
                       "a link that saves needs the id that /api/scenes lists or the log tells");
    const auto now = std::chrono::system_clock::now() + parse_duration(options->expires);
    options->grant.expires_unix_s =
        std::chrono::duration_cast<std::chrono::seconds>(now.time_since_epoch()).count();
    options->grant.id = new_link_id();
    std::cout << make_link_token(options->grant,
                                 read_key_file("--token-key-file", options->key_file))
              << '\n';
    std::cerr << "its id is " << options->grant.id
              << ": a line with it in the file of --revoked-links ends this link\n"
              << "append it to the page's address: https://HOST/"
              << (scene_id.empty() ? "" : "?scene=" + scene_id)
              << (options->grant.role != "author" ? ""
                  : scene_id.empty()              ? "?author"
                                                  : "&author")
              << "#token=TOKEN\n";
    if (by_name)
      std::cerr << "\"" << scene_id
                << "\" is a name: the link opens a scene only while no other has that name. An id "
                   "that /api/scenes lists belongs to one file.\n";
    exit_code = 0;
  });
}

}  // namespace catgs
