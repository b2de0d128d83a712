// The parameters of every node as documentation: the YAML files in config/ and docs/parameters.md.

#include <algorithm>
#include <filesystem>
#include <fstream>
#include <iostream>
#include <sstream>

#include "command_line.hpp"
#include "files/output_file.hpp"
#include "other_nodes.hpp"
#include "params_check.hpp"
#include "urban_gnss_localization/localizers/registry.hpp"
#include "urban_gnss_localization/parameters/parameter_list.hpp"
#include "urban_gnss_localization/ros/registered_localizer_node.hpp"

using namespace urban_gnss;

namespace {

namespace fs = std::filesystem;

/// A file that is made of the parameter structs.
struct Page {
  std::string file;  ///< below the package's folder
  std::string text;
};

Page yaml_page(const std::string& name, const std::string& title, const ParameterList& list) {
  std::ostringstream text;
  write_yaml(text, title + " The values are the defaults; docs/parameters.md has their ranges.", list);
  return {"config/" + name + ".yaml", text.str()};
}

/// What a localizer's node reads beside config/localization.yaml.
ParameterList own_parameters(const LocalizerEntry& entry) {
  LocalizerNodeSettings settings(entry);
  ParameterList own;
  own.include(*settings.localizer);
  if (settings.has_particles) own.include(settings.particles);
  return own;
}

/// The parameters that all localizers with these shared parameters have.
ParameterList shared_parameters(const std::string& name, const LocalizerRegistry& localizers) {
  ParameterList shared;
  bool is_first = true;
  for (const LocalizerEntry& entry : localizers.entries()) {
    if (entry.shared_parameters != name) continue;
    const ParameterList own = own_parameters(entry);
    shared = is_first ? own : shared.kept([&](const ListedParameter& each) { return own.has(each); });
    is_first = false;
  }
  return shared;
}

/// The files that roslaunch loads into the node of a localizer.
void add_localizer_pages(const LocalizerRegistry& localizers, std::vector<Page>& pages) {
  const LocalizerNodeSettings any(localizers.entries().front());
  pages.push_back(
      yaml_page("localization", "What every localizer is told, beside its own file.", ParameterList().add(any.shell)));
  std::vector<std::string> done;
  for (const LocalizerEntry& entry : localizers.entries()) {
    const std::string& name = entry.shared_parameters;
    const ParameterList shared = name.empty() ? ParameterList() : shared_parameters(name, localizers);
    if (!name.empty() && std::find(done.begin(), done.end(), name) == done.end()) {
      pages.push_back(yaml_page(name, "What the localizers of the same model are told alike.", shared));
      done.push_back(name);
    }
    const std::string others = "config/localization.yaml" + (name.empty() ? "" : " and config/" + name + ".yaml");
    pages.push_back(
        yaml_page(entry.name, entry.name + "_node. " + entry.summary + " The rest is in " + others + ".",
                  own_parameters(entry).kept([&](const ListedParameter& each) { return !shared.has(each); })));
  }
}

std::vector<Page> all_pages(const LocalizerRegistry& localizers) {
  std::ostringstream docs;
  docs << "# Parameters\n\n"
          "Made by `rosrun urban_gnss_localization parameters --write DIR`; a test fails where it is stale.\n\n"
          "The first table of a node has what a user sets. The others are written below `expert:` and the groups that\n"
          "the dots show; their defaults serve. A node that finds an unknown name or a bad value says so and stops.\n";
  const auto document = [&](const std::string& node, const std::string& summary, const ParameterList& list) {
    docs << "\n## " << node << "\n\n" << summary << "\n\n";
    write_markdown(docs, list);
  };
  std::vector<Page> pages;
  add_localizer_pages(localizers, pages);
  for (const LocalizerEntry& entry : localizers.entries()) {
    document(entry.name + "_node", entry.summary, ParameterList().add(LocalizerNodeSettings(entry)));
  }
  for_each_other_node([&](const std::string& name, const std::string& summary, const auto& parameters) {
    const ParameterList list = ParameterList().add(parameters);
    pages.push_back(yaml_page(name, name + "_node. " + summary, list));
    document(name + "_node", summary, list);
  });
  pages.push_back({"docs/parameters.md", docs.str()});
  return pages;
}

void write_pages(const fs::path& directory) {
  for (const Page& page : all_pages(standard_localizers())) {
    write_file(directory / page.file, InputFiles(), [&](std::ostream& out) { out << page.text; });
  }
}

void check_pages(const fs::path& directory) {
  std::string stale;
  for (const Page& page : all_pages(standard_localizers())) {
    std::ifstream file(directory / page.file, std::ios::binary);
    std::ostringstream text;
    text << file.rdbuf();
    if (text.str() != page.text) stale += "\n  " + page.file;
  }
  if (!stale.empty()) throw std::runtime_error("stale, renew by `parameters --write DIR`:" + stale);
}

/// What the nodes would read of a file, or all that they would refuse.
void read_file(const std::string& file) {
  const ParamsCheck check = check_params(file, standard_localizers());
  if (!check.faults.empty()) throw ParameterError(file, check.faults);
  if (!check.hint.empty()) std::cerr << check.hint << '\n';
  for (const std::string& section : check.sections) std::cout << file << ": section " << section << " can be read\n";
}

}  // namespace

int main(int argc, char** argv) {
  std::string write_directory;
  std::string check_directory;
  std::string params;
  CommandLine line("parameters", "Prints the parameters of every node: place, default, unit, range, meaning.");
  line.add_output_folder("--write", write_directory,
                        "renew config/*.yaml and docs/parameters.md below this folder, the package's");
  line.app().add_option("--check", check_directory, "fail where one of these files is stale");
  line.app().add_option("--params", params, "read a file of params:= as the nodes do, and say what they would refuse");
  return line.run(argc, argv, [&] {
    if (!params.empty()) return read_file(params);
    if (!write_directory.empty()) write_pages(write_directory);
    if (!check_directory.empty()) check_pages(check_directory);
    if (write_directory.empty() && check_directory.empty()) std::cout << all_pages(standard_localizers()).back().text;
  });
}
