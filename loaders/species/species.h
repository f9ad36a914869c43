// Finds the species in file names, the family of the SMAL shape space to which a species belongs, and animals
// that are not quadrupeds.
#pragma once

#include <optional>
#include <string>
#include <string_view>

#include "manifests/sample.h"

namespace q3d::loaders::species {

// Returns the name in lower case with single spaces. '+' and '_' become spaces ("german+shepherd").
std::string normalised_species(std::string_view name);

// Returns the name of a sub-dataset in lower case with letters and digits only, because their spelling varies
// ("AwA-Pose", "stanforddogs", "AP_10K").
std::string normalised_source(std::string_view name);

// Returns the species that a picture's name or its sub-dataset tells, or "":
// - `<species>_<number>_<number>.jpg` (AwA-Pose), if the family table knows the species;
// - `n<8 digits>_<number>` (ImageNet): the animal of the synset, a dog for all breeds of StanfordDogs;
// - `<12 digits>_<class>` (COCO pictures of Animal3D);
// - sub-datasets of one animal (horse-10, cheetah, stanforddogs, iRodents), compared without case, '-' and
//   '_';
// - AnimalPose's ca, co, do, ho, sh with a number.
std::string species_of_picture(std::string_view file_name, std::string_view source_dataset);

// Returns the family of a species, Family::none for animals outside the five families, and nothing for a name
// that the table lacks. "polar bear" is found by its last word. Names that this would mislead ("prairie dog")
// are in the table.
//
// The table is zoological. Felidae, Canidae, Equidae, Bovidae and Hippopotamidae are those of Wilson &
// Reeder's Mammal Species of the World (3rd edition, 2005), and they are SMAL's five shape families. AniMer's
// author counts sheep with the horses; PRIMA's paper and this table have them in Bovidae. A family that the
// annotation file states always wins.
std::optional<manifests::Family> family_of_species(std::string_view species);

// This is how Animal Kingdom classifies an animal. Its mammal split contains birds, primates, kangaroos and
// other animals that the body of a quadruped cannot represent.
struct AnimalClass {
  std::string parent_class;  // "Mammal"
  std::string animal_class;
  std::string subclass;  // "Dog / Wolf / Fox / Coyote / Jackal"
  std::string animal;    // "Wolf"
};

// Returns the rule that leaves an animal out, or "". An animal is left out if its class is not mammals, or if
// a listed word is, or ends, the animal's name or one of the names of its subclass.
std::string not_a_quadruped(const AnimalClass& animal);

// Returns the family by the animal's name. If the table lacks it, the subclass decides, provided that all
// names there agree.
std::optional<manifests::Family> family_of(const AnimalClass& animal);

}  // namespace q3d::loaders::species
