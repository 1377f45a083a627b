#include "server/commands.h"

#include <chrono>
#include <iostream>
#include <memory>
#include <string>

#include <CLI/CLI.hpp>
#include <fmt/chrono.h>
#include <fmt/format.h>

#include "render_core/base/error.h"
#include "server/access/access.h"
#include "server/base/scene_id.h"
#include "server/encode/selftest.h"
#include "server/net/http.h"

namespace catgs {
namespace {

struct TokenOptions {
  LinkGrant grant;
  std::string expires = "7d";
  std::string key_file;
  std::string address;  // of the page; empty: the token alone is printed
};

/// Throws InputError unless a page may have this address.
std::string page_address(std::string address) {
  const std::size_t scheme = address.starts_with("https://")  ? 8
                             : address.starts_with("http://") ? 7
                                                              : 0;
  if (scheme == 0 || address.size() == scheme || address.find_first_of("?# ") != address.npos)
    throw InputError("--address " + address, {}, "is no address of a page",
                     "give it without ? and #, such as https://museum.example/");
  if (!address.ends_with('/') && !address.ends_with(".html")) address += '/';
  return address;
}

std::string link_to(const std::string& page, const LinkGrant& grant, const std::string& token) {
  std::string query = grant.scene_id.empty() ? "" : "?scene=" + percent_encoded(grant.scene_id);
  if (grant.role == "author") query += query.empty() ? "?author" : "&author";
  return fmt::format("{}{}#token={}", page, query, token);
}

}  // namespace

void add_selftest_command(CLI::App& app, int& exit_code) {
  CLI::App* command =
      app.add_subcommand("selftest", "Test and time every encoder; say why one cannot be used");
  command->callback([&exit_code] { exit_code = run_selftest(std::cout); });
}

void add_token_command(CLI::App& app, int& exit_code) {
  CLI::App* command = app.add_subcommand("token", "Make an access token for an expiring link");
  command->footer(
      "Example: catgs-server token --token-key-file KEY --scene hall-kdfmqrtv --address "
      "https://museum.example/");
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
  command->add_option("--address", options->address,
                      "Address of the page: prints the whole link; without it the token");
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
    const std::string page = options->address.empty() ? "" : page_address(options->address);
    const std::string token =
        make_link_token(options->grant, read_key_file("--token-key-file", options->key_file));
    std::cout << (page.empty() ? token : link_to(page, options->grant, token)) << '\n';
    std::cerr << fmt::format(
        "valid for {}, until {:%Y-%m-%d %H:%M} UTC\n"
        "its id is {}: a line with it in the file of --revoked-links ends this link\n",
        options->expires, fmt::gmtime(options->grant.expires_unix_s), options->grant.id);
    if (page.empty())
      std::cerr << "append it to the page's address: "
                << link_to("https://HOST/", options->grant, "TOKEN") << '\n';
    if (by_name)
      std::cerr << "\"" << scene_id
                << "\" is a name: the link opens a scene only while no other has that name. An id "
                   "that /api/scenes lists belongs to one file.\n";
    exit_code = 0;
  });
}

}  // namespace catgs
